"""Promises of plans with conditions on numbers: what is known of boxes that grew before, and networks made smaller."""

from fractions import Fraction
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust import Monitor, load_plan
from robust.execute import slice_forecast, slices
from robust.execute.controllable_boxes import ParametricLink, ParametricStnu, ends_of
from robust.execute.dispatchable import first_windows
from robust.plan.model import ZERO, TimePoint, TimePointKind
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Interval
from tests.execute.replays import OPEN, SHARED, TICK, cases, replayed
from tests.sampling import often

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples" / "generator"
LIMITED = """
durative-action instance shift : (run-shift gen);
durative-action instance pour_1 : (pour gen can1);
durative-action instance pour_2 : (pour gen can2);
durative-action instance pour_3 : (pour gen can3);
c: shift.start - .zero in [0, 0];
c: shift.end - shift.start in [148, 148];
c: pour_1.start - .zero in [20, 22];
c: pour_1.end - pour_1.start in [12, 12];
c: pour_2.start - pour_1.end in [24, 26];
c: pour_2.end - pour_2.start in [12, 12];
c: pour_3.start - pour_2.end in [24, 26];
c: pour_3.end - pour_3.start in [12, 12];
c: pour_3.end - .zero in [0, 112];
c: shift.end - pour_3.end in [38, 44];
"""
"""Pours one after the other, up to a limit, and the last one ends well before the shift, of which nobody knows how
long it takes."""
POINTS = (ZERO, *(TimePoint(TimePointKind.INSTANT, name) for name in "abcdefg"))


@pytest.fixture
def timeless(monkeypatch):
    """Limits of time that no machine reaches, or reaches at once."""
    monkeypatch.setattr(slice_forecast, "SLICE_SECONDS", None)
    monkeypatch.setattr(slice_forecast, "REGION_SECONDS", None)
    monkeypatch.setattr(slice_forecast, "FIRST_SECONDS", None)
    monkeypatch.setattr(slice_forecast, "GROWTH_SECONDS", 0)


@pytest.fixture
def monitor(timeless, tmp_path):
    (tmp_path / "plan.stn").write_text(LIMITED)
    files = (EXAMPLES / "domain.pddl", EXAMPLES / "problem.pddl", tmp_path / "plan.stn")
    return lambda: Monitor(load_plan(*files, parameters=["duration:*"]), reorder=False, seconds=None)


def width(promise) -> Fraction | None:
    widths = [None if most is None else most - least for least, most in promise.values()]
    return None if None in widths else sum(widths, Fraction(0))


def test_what_boxes_met_holds_as_more_happens(monitor):
    """Promises are as wide with what growing boxes met before as without it."""
    monitor, compared = monitor(), 0
    forecaster = monitor._own

    def widened(met):
        """The promise around what is planned."""
        forecaster._met, forecaster._box, forecaster._last = met, Box.nominal(monitor.plan.parameters), None
        return monitor.assess().promise

    monitor.say("start", "shift", at=0)
    for step in ("pour_1", "pour_2", "pour_3"):
        looks = {look.step: look for look in monitor.outlook().coming + monitor.outlook().startable}
        outlook = monitor.say("start", step, at=looks[step].start[0])
        for _ in range(3):
            outlook = monitor.say("tick", at=outlook.wake)
            monitor.assess()
            met = forecaster._met
            assert widened([]) == widened(met)
            compared += bool(met)
        monitor.say("end", step, at=outlook.time + Fraction(1, 8))
    assert compared > 5


def test_new_promises_are_wide_at_once_and_as_wide_as_may_be_when_assessed(monitor):
    monitor = monitor()
    monitor.say("start", "shift", at=0)
    kept = monitor.say("start", "pour_1", at=20)
    assert width(kept.promise) > 0
    left = monitor.say("tick", at=kept.wake)
    assert not left.promise["pour_1"][0] <= kept.promise["pour_1"][1]
    assert width(left.promise) > 0
    least, most = left.promise["pour_1"]
    assert least < most, "what is late is given more time"
    assessed = monitor.assess()
    assert width(left.promise) < width(assessed.promise)
    assert assessed.promise["pour_1"][1] >= most
    assert monitor.outlook() == assessed
    assert monitor.say("tick", at=assessed.time).promise == assessed.promise, "nothing is taken back"


@pytest.mark.skipif(not (SHARED / "planner-logs").is_dir(), reason="no logs of planners")
def test_nothing_that_is_left_stays_nothing_until_something_is_taken_back(monkeypatch):
    monkeypatch.setattr(slice_forecast, "SLICE_SECONDS", None)
    monkeypatch.setattr(slice_forecast, "FIRST_SECONDS", 0)
    (case,) = (case for case in cases() if case.name == "rovers-2006-4")
    monitor = case.monitor("+20%", reorder=False, seconds=None)
    forecaster, looked = monitor._own, 0
    for message, outlook in replayed(monitor, Random(3), Fraction(1, 4)):  # noqa: S311
        if outlook.prospect in OPEN and outlook.promise is None and message.kind is not TICK:
            assert forecaster._is_nothing_left
            forecaster._is_nothing_left, forecaster._last = False, None
            assert monitor.outlook().promise is None
            looked += 1
        elif looked == 0:
            promised = monitor.count
    assert looked > 5
    for number in sorted((number for number in monitor.taken if number > promised), reverse=True):
        assert monitor.say("retract", str(number)).refused is None
    assert monitor.outlook().promise is not None


def drawn(random: Random) -> ParametricStnu:
    """A network in which orders imply each other, with lengths that nature chooses."""
    links = [
        ParametricLink(ZERO, point, Polynomial({}), None, origin=f"{point} is not before zero") for point in POINTS[1:]
    ]
    for _ in range(random.randint(4, 14)):
        source, target = random.sample(POINTS, 2)
        lower = Polynomial.constant(random.choice([-2, 0, 0, 0, 1, 1, 2]))
        links.append(ParametricLink(source, target, lower, None, origin="order"))
    for target in random.sample(POINTS[1:], 2):
        length = Polynomial.variable(random.choice("pq"))
        if not any(link.is_contingent and target in (link.source, link.target) for link in links):
            source = random.choice([point for point in POINTS if point != target])
            links.append(ParametricLink(source, target, length, length, True, origin=str(length)))
    for _ in range(random.randint(0, 3)):
        source, target = random.sample(POINTS, 2)
        links.append(ParametricLink(source, target, None, Polynomial.constant(random.randint(1, 9)), origin="limit"))
    random.shuffle(links)
    return ParametricStnu(POINTS, tuple(links), {})


def test_orders_that_are_implied_change_nothing():
    seen, smaller = set(), 0
    for seed in range(often(300, 5000)):
        random = Random(seed)  # noqa: S311
        network = drawn(random)
        times = {point: Fraction(random.randint(0, 3)) for point in POINTS}  # of no schedule: only sizes depend on them
        fewer = network.without_implied_orders(times)
        box = Box({"p": Interval(Fraction(1), Fraction(3)), "q": Interval(Fraction(0), Fraction(1))})
        answers = [each.dynamic(ends_of(box)).is_controllable for each in (network, fewer)]
        assert answers[0] is answers[1], seed
        if answers[0]:
            assert first_windows(network, box) == first_windows(fewer, box), seed
        seen.add(answers[0])
        smaller += len(fewer.links) < len(network.links)
    assert seen == {True, False}
    assert smaller > 100


def test_nothing_happens_before_now_whatever_orders_say():
    """After a timed literal that is over means nothing; after what is open, not before now."""
    literal = TimePoint(TimePointKind.TIMED_LITERAL, time=Fraction(5))
    a, b, c = POINTS[1:4]
    one, five = Polynomial.constant(1), Polynomial.constant(5)
    links = [ParametricLink(ZERO, literal, five, five), ParametricLink(literal, a, one, None)]
    links += [ParametricLink(b, c, one, None), ParametricLink(ZERO, b, one, None)]
    network = ParametricStnu((ZERO, literal, a, b, c), tuple(links), {})
    rest = slices.continued(network, slices.Observations(Fraction(20), times={ZERO: Fraction(0)}))
    windows = first_windows(rest, Box({}))
    assert [windows[point][0] for point in (a, b, c)] == [20, 20, 21]
    assert [link.target for link in rest.links if "before now" in link.origin] == [a, b]


@st.composite
def intervals(draw):
    lower = draw(st.none() | st.integers(-2, 2))
    upper = draw(st.none() | st.integers(-2 if lower is None else lower, 3))
    closed = draw(st.booleans()), draw(st.booleans())
    if lower == upper:
        closed = True, True
    return Interval(None if lower is None else Fraction(lower), None if upper is None else Fraction(upper), *closed)


@given(intervals(), intervals())
def test_common_values_are_in_both(first, second):
    common = slices._common(first, second)
    for value in (Fraction(number, 2) for number in range(-8, 9)):
        assert (value in first and value in second) is (common is not None and value in common)
