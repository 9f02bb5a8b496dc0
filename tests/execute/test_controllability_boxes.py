"""Boxes of plans: which parameters are contingent, what is decided, and the part that is controllable."""

import json
import random
from fractions import Fraction
from itertools import product

import pytest

import robust
from robust.errors import InputError, UnsupportedError
from robust.execute.controllability.assess import Controllability, Kind, Verdict, shrink
from robust.execute.controllability.boxes import HORIZON, ends_of, loss, parametric_stnu
from robust.execute.controllability.dynamic import ContingentLink, RequirementLink
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Interval, Side
from robust.smt.limits import Deadline, OutOfTimeError
from tests.execute.controllability_oracles import bound as bound_distance
from tests.execute.controllability_oracles import consistent, dynamic_by_reductions, weak_by_corners
from tests.execute.execution import interval

NOMINAL = Fraction(4)


def bound(value):
    """A number, None, or a sum of names of parameters with a number."""
    if value is None or isinstance(value, Polynomial):
        return value
    if isinstance(value, str):
        return Polynomial.variable(model.ParameterReference(value))
    return Polynomial.constant(Fraction(value))


def plan_of(parameters, instances, constraints, literals=()):
    """A plan that has nothing but a network; constraints are (source, target, lower, upper), time points by name."""
    actions = tuple(model.ActionInstance(name, "do", (), durative=True) for name in instances)
    places = {"Z": model.ZERO, **{str(p): p for one in actions for p in one.time_points}}
    return model.ParametrizedPlan(
        name="network",
        parameters=tuple(parameters),
        instances=actions,
        constraints=tuple(
            model.TemporalConstraint(places[a], places[b], bound(low), bound(high)) for a, b, low, high in constraints
        ),
        initial_atoms=frozenset(),
        initial_fluents={},
        timed_literals=tuple(literals),
        goal=(),
    )  # fmt: skip


def one_of(names):
    return [model.Parameter(name, NOMINAL) for name in names]


def box_of(**intervals):
    return Box(
        {name: Interval(*(None if e is None else Fraction(e) for e in ends)) for name, ends in intervals.items()}
    )


TWO = [("a.start", "a.end", "p", "p"), ("b.start", "b.end", "q", "q")]
MEET = plan_of(one_of("pq"), "ab", [*TWO, ("a.end", "b.start", -1, 2)])
"""The start of b is to be close to the end of a, at most one before."""


def verdicts(plan, box):
    return tuple(one.verdict for one in Controllability(plan, box).findings())


YES, NO, OPEN = Verdict.CONTROLLABLE, Verdict.NOT_CONTROLLABLE, Verdict.UNKNOWN


# -- what is contingent ----------------------------------------------------------------------------------------------


def links_of(plan, box):
    stnu = parametric_stnu(plan, box).at(ends_of(box))
    return {
        (str(link.source), str(link.target)): (link.lower, link.upper)
        for link in stnu.links
        if isinstance(link, ContingentLink)
    }


def test_durations_and_starts_are_contingent():
    links = [("Z", "b.start", "s", "s"), ("b.start", "b.end", 3, 3), ("a.end", "b.end", 1, 1)]
    plan = plan_of(one_of("ps"), "ab", [TWO[0], *links])
    assert links_of(plan, box_of(p=(1, None), s=(0, 9))) == {
        ("a.start", "a.end"): (1, None),
        (".zero", "b.start"): (0, 9),
        ("b.start", "b.end"): (3, 3),
    }


def test_links_are_turned_so_that_they_have_a_length():
    minus = -bound("p")
    plan = plan_of(one_of("pd"), "ab", [("a.end", "a.start", minus, minus), ("b.start", "a.end", "d", "d")])
    assert links_of(plan, box_of(p=(2, 5), d=(-3, -1))) == {
        ("a.start", "a.end"): (2, 5),
        ("a.end", "b.start"): (1, 3),
    }
    plan = plan_of(one_of("d"), "ab", [("b.start", "a.start", "d", "d")])
    assert links_of(plan, box_of(d=(-3, -1))) == {("a.start", "b.start"): (1, 3)}


def test_each_time_point_ends_one_contingent_link_and_none_goes_round():
    plan = plan_of(one_of("pqr"), "ab", [*TWO, ("a.end", "b.start", "r", "r"), ("b.end", "a.start", "r", "r")])
    found = links_of(plan, box_of(p=(1, 2), q=(1, 2), r=(1, 2)))
    assert found == {("a.start", "a.end"): (1, 2), ("b.start", "b.end"): (1, 2), ("a.end", "b.start"): (1, 2)}


def test_a_timed_literal_is_no_end():
    plan = plan_of([], "a", [], [model.TimedLiteral(Fraction(7), model.Atom("dark"), value=True)])
    stnu = parametric_stnu(plan, Box({})).at({})
    (fixed,) = [one for one in stnu.links if isinstance(one, RequirementLink) and one.upper is not None]
    assert (fixed.lower, fixed.upper, fixed.source) == (7, 7, model.ZERO)


def test_bounds_that_are_not_linear_are_refused():
    square = bound("p") * bound("p")
    with pytest.raises(UnsupportedError, match="not linear"):
        parametric_stnu(plan_of(one_of("p"), "a", [("a.start", "a.end", square, square)]), box_of(p=(1, 2)))


# -- verdicts --------------------------------------------------------------------------------------------------------


def two(*constraints, extra=()):
    """Two actions whose durations are parameters, with requirements."""
    return plan_of([*one_of("pq"), *extra], "ab", [*TWO, *constraints])


BEFORE = ("b.start", "a.end", 1, 3)
LONG_BEFORE = two(("b.start", "a.end", 1, 6))


@pytest.mark.parametrize(
    ("plan", "intervals", "expected"),
    [
        (MEET, {"p": (4, 4), "q": (1, 9)}, (YES, YES, YES)),
        (MEET, {"p": (3, 6), "q": (1, 9)}, (YES, YES, YES)),
        (MEET, {"p": (3, 7), "q": (1, 9)}, (YES, YES, NO)),
        (two(BEFORE), {"p": (3, 7), "q": (1, 9)}, (YES, NO, NO)),
        (two(("Z", "b.end", 0, 9)), {"p": (3, 7), "q": (1, 10)}, (NO, NO, NO)),
        # A parameter that is not in the network does not matter.
        (
            two(("a.end", "b.start", -1, 2), extra=[model.Parameter("rate", NOMINAL)]),
            {"p": (3, 7), "q": (1, 9), "rate": (None, None)},
            (YES, YES, NO),
        ),
        # What may never end is no matter for those who see it.
        (MEET, {"p": (3, None), "q": (1, None)}, (YES, YES, NO)),
        (two(("a.end", "b.start", -2, -1)), {"p": (3, None), "q": (1, None)}, (YES, NO, NO)),
        (two(("a.end", "b.start", 0, None)), {"p": (3, None), "q": (1, None)}, (YES, YES, NO)),
    ],
)
def test_verdicts(plan, intervals, expected):
    assert verdicts(plan, box_of(**intervals)) == expected


def test_a_shared_parameter_is_decided_as_far_as_possible():
    """Both take as long: whoever sees the first end knows the second."""
    again = [("a.start", "a.end", "p", "p"), ("a.end", "b.start", 0, 0), ("b.start", "b.end", "p", "p")]
    free = plan_of(one_of("p"), "ab", again)
    assert verdicts(free, box_of(p=(1, 9))) == (YES, YES, NO)
    # c ends with b: found out in time, but not by a network with independent links.
    with_c = [*again, ("c.start", "c.end", 1, 1), ("c.end", "b.end", 0, 0)]
    known = plan_of(one_of("p"), "abc", with_c)
    finding = Controllability(known, box_of(p=(1, 9))).finding(Kind.DYNAMIC)
    assert finding.verdict is OPEN
    assert finding.reason == "p is the length of 2 links, the first of which reveals the others"
    # Even who knows p cannot make b end that early.
    hopeless = plan_of(one_of("p"), "ab", [*again, ("Z", "b.end", 0, 10)])
    finding = Controllability(hopeless, box_of(p=(1, 9))).finding(Kind.DYNAMIC)
    assert finding.verdict is NO
    assert finding.reason.endswith("even if p = 9 is known")


def test_a_shared_parameter_is_no_matter_for_fixed_schedules():
    """Two that start together and take equally long end together, although neither end is known."""
    together = [("a.start", "a.end", "p", "p"), ("b.start", "b.end", "p", "p"), ("a.end", "b.end", 0, 0)]
    assert verdicts(plan_of(one_of("p"), "ab", together), box_of(p=(1, 9))) == (YES, YES, YES)
    asked = Controllability(plan_of(one_of("p"), "ab", together), box_of(p=(1, 9)))
    assert asked.shrunk(Kind.DYNAMIC).box == asked.box
    assert asked.waits() == ()


def test_a_parameter_in_a_requirement_is_hidden():
    cooling = plan_of(one_of("pw"), "ab", [("a.start", "a.end", "p", "p"), ("a.end", "b.start", "w", 9)])
    assert verdicts(cooling, box_of(p=(1, 5), w=(2, 8))) == (YES, YES, NO)
    twice = plan_of(one_of("w"), "ab", [("a.start", "b.start", "w", "w"), ("Z", "b.start", "w", "w")])
    assert verdicts(twice, box_of(w=(2, 8))) == (YES, YES, YES)
    window = plan_of(one_of("w"), "a", [("Z", "a.start", "w", bound("w") + 3)])
    assert verdicts(window, box_of(w=(2, 5))) == (YES, YES, YES)
    assert verdicts(window, box_of(w=(2, 8))) == (YES, OPEN, NO)
    assert shrink(window, box_of(w=(2, 8)), Kind.DYNAMIC) == box_of(w=("5/2", "11/2"))
    endless = plan_of(one_of("w"), "a", [("Z", "a.start", "w", None)])
    assert verdicts(endless, box_of(w=(2, None))) == (YES, OPEN, NO)


def test_a_link_that_may_end_before_it_starts_is_left_open():
    late = plan_of(one_of("d"), "ab", [("a.start", "b.start", "d", "d")])
    assert verdicts(late, box_of(d=(-1, 2))) == (YES, YES, YES)
    chain = [("c.start", "c.end", "p", "p"), ("c.end", "a.start", 0, 0), ("a.start", "b.start", "d", "d")]
    plan, box = plan_of([*one_of("p"), model.Parameter("d", Fraction(1))], "abc", chain), box_of(p=(2, 3), d=(-1, 2))
    finding = Controllability(plan, box).finding(Kind.DYNAMIC)
    assert finding.verdict is OPEN
    assert "may end before it starts" in finding.reason
    assert shrink(plan, box, Kind.DYNAMIC) == box_of(p=(2, 3), d=(0, 2))


def test_running_out_of_time_is_unknown():
    asked = Controllability(MEET, box_of(p=(3, 7), q=(1, 9)), deadline=Deadline.after(0))
    assert asked.finding(Kind.DYNAMIC).verdict is OPEN
    assert asked.finding(Kind.DYNAMIC).reason == "out of time"
    with pytest.raises(OutOfTimeError):
        asked.shrunk(Kind.DYNAMIC)


# -- shrinking -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("plan", "kind", "p", "q", "expected"),
    [
        (two(BEFORE), Kind.DYNAMIC, "[1, 9]", "[1, 9]", "[3, 5]"),
        (MEET, Kind.STRONG, "[1, 9]", "[1, 9]", "[5/2, 11/2]"),
        (MEET, Kind.STRONG, "[3, 9]", "[1, 9]", "[3, 6]"),
        # Infinite ends come back where they have to.
        (LONG_BEFORE, Kind.DYNAMIC, "[3, inf)", "[1, inf)", "[3, 8]"),
        (LONG_BEFORE, Kind.STRONG, "[1, inf)", "[1, inf)", "[3/2, 13/2]"),
        # Open ends stay open.
        (LONG_BEFORE, Kind.DYNAMIC, "(1, 9]", "[1, inf)", "[3/2, 13/2]"),
        (LONG_BEFORE, Kind.DYNAMIC, "(3, 9]", "[1, inf)", "(3, 8]"),
        (LONG_BEFORE, Kind.DYNAMIC, "[1, 8)", "[1, inf)", "[3/2, 13/2]"),
        (LONG_BEFORE, Kind.DYNAMIC, "[3, 8)", "[1, inf)", "[3, 8)"),
        # Weakly controllable is the box itself; one beside the nominal point shrinks to its middle.
        (MEET, Kind.WEAK, "[1, 9]", "[1, 9]", "[1, 9]"),
        (two(BEFORE), Kind.DYNAMIC, "[10, 20]", "[1, 9]", "[14, 16]"),
    ],
)
def test_the_controllable_part_is_max_min_fair(plan, kind, p, q, expected):
    part = shrink(plan, Box({"p": interval(p), "q": interval(q)}), kind)
    assert str(part) == f"p ∈ {expected}, q ∈ {q}"


def test_weights_and_what_is_lost():
    heavy = plan_of(
        [model.Parameter("p", NOMINAL, Fraction(2)), model.Parameter("q", NOMINAL)],
        "ab",
        [*TWO, ("a.end", "b.end", -3, 3)],
    )
    part = shrink(heavy, box_of(p=(0, 9), q=(0, 9)), Kind.STRONG)
    assert part == box_of(p=(2, 6), q=(3, 5))
    assert loss(box_of(p=(0, 9), q=(0, 9)), part).share == Fraction(12, 18)


def test_faces_that_may_be_anywhere_but_not_nowhere():
    after = two(("a.end", "b.start", 0, None))
    box = box_of(p=(1, None), q=(1, None))
    shrunk = Controllability(after, box).shrunk(Kind.STRONG)
    assert shrunk.box == box_of(p=(1, NOMINAL + HORIZON), q=(1, None))
    assert shrunk.cut == (("p", Side.UPPER),)
    assert verdicts(after, shrunk.box) == (YES, YES, YES)
    lost = loss(box, shrunk.box)
    assert (lost.share, lost.unbounded) == (None, (("p", Side.UPPER),))
    assert Controllability(after, box).shrunk(Kind.DYNAMIC).box == box


@pytest.mark.parametrize("kind", [Kind.DYNAMIC, Kind.STRONG])
def test_a_network_without_a_schedule_has_no_part(kind):
    late = two(("Z", "a.end", 0, 3))
    with pytest.raises(InputError, match="no schedule at the nominal values"):
        shrink(late, box_of(p=(3, 7), q=(1, 9)), kind)


# -- against slow ways -----------------------------------------------------------------------------------------------


def random_plan(rng):
    """Three actions of uncertain length with requirements between their ends; most have schedules."""
    names = "abc"[: rng.randint(2, 3)]
    parameters = [model.Parameter(f"p{name}", NOMINAL, Fraction(rng.choice([1, 1, 2]))) for name in names]
    constraints = [(f"{name}.start", f"{name}.end", f"p{name}", f"p{name}") for name in names]
    points = [f"{name}.{side}" for name in names for side in ("start", "end")]
    for _ in range(rng.randint(1, 4)):
        source, target = rng.sample(points, 2)
        low = rng.randint(-6, 4)
        constraints.append((source, target, low, low + rng.randint(1, 7)))
    return plan_of(parameters, names, constraints)


def dynamic_oracle(plan, box):
    return dynamic_by_reductions(parametric_stnu(plan, box).at(ends_of(box)))


def strong_oracle(plan, box):
    """A schedule of the starts that suits every corner: one network with the requirements of all corners."""
    stnu = parametric_stnu(plan, box).at(ends_of(box))
    links = stnu.contingents
    before = {link.target: link for link in links}
    edges = {}
    for corner in product(*((link.lower, link.upper) for link in links)):
        length = dict(zip(links, corner, strict=True))

        def place(p, length=length):
            return (before[p].source, length[before[p]]) if p in before else (p, Fraction(0))

        for link in stnu.links:
            if isinstance(link, RequirementLink):
                (a, before_a), (b, before_b) = place(link.source), place(link.target)
                lower, upper = (None if e is None else e + before_a - before_b for e in (link.lower, link.upper))
                bound_distance(edges, a, b, lower, upper)
    return consistent(stnu.points, edges)


def widened(plan, part, box, name, side):
    """The part with one face a little farther out, as far as the box goes; None if it is there."""
    old, outer = part[name], box[name]
    tiny = Fraction(1, 10**6)
    if side is Side.UPPER:
        return None if old.upper == outer.upper else part.replace(name, Interval(old.lower, old.upper + tiny))
    return None if old.lower == outer.lower else part.replace(name, Interval(old.lower - tiny, old.upper))


ORACLES = {Kind.DYNAMIC: dynamic_oracle, Kind.STRONG: strong_oracle}


@pytest.mark.parametrize("kind", ORACLES)
def test_parts_are_controllable_and_no_face_can_move(kind):
    oracle, shrunk, kept = ORACLES[kind], 0, 0
    for seed in range(150):
        plan = random_plan(random.Random(seed))  # noqa: S311
        box = Box(
            {p.name: Interval(Fraction(1), Fraction(random.Random(seed).choice([6, 9]))) for p in plan.parameters}  # noqa: S311
        )
        if not dynamic_oracle(plan, Box.nominal(plan.parameters)):
            with pytest.raises(InputError):
                shrink(plan, box, kind)
            continue
        part = shrink(plan, box, kind)
        assert (part == box) is oracle(plan, box), seed
        assert oracle(plan, part), seed
        assert Controllability(plan, part).finding(kind).verdict is YES
        for name in part.intervals:
            assert part[name].is_within(box[name])
            for side in Side:
                wider = widened(plan, part, box, name, side)
                assert wider is None or not oracle(plan, wider), (seed, name, side)
        shrunk += part != box
        kept += part == box
    assert shrunk > 30
    assert kept > 5


def test_verdicts_agree_with_slow_ways_and_imply_each_other():
    seen = set()
    for seed in range(200):
        rng = random.Random(seed)  # noqa: S311
        plan = random_plan(rng)
        box = Box({
            p.name: Interval(NOMINAL - rng.randint(0, 2), NOMINAL + rng.randint(0, 2)) for p in plan.parameters
        })  # fmt: skip
        weakly, dynamically, strongly = (verdict is YES for verdict in verdicts(plan, box))
        assert weakly is weak_by_corners(parametric_stnu(plan, box).at(ends_of(box))), seed
        assert dynamically is dynamic_oracle(plan, box), seed
        assert strongly is strong_oracle(plan, box), seed
        assert weakly >= dynamically >= strongly
        seen.add((weakly, dynamically, strongly))
    assert len(seen) == 4


def test_a_strong_schedule_suits_all_values():
    suited = 0
    for seed in range(120):
        rng = random.Random(seed)  # noqa: S311
        plan = random_plan(rng)
        box = Box({p.name: Interval(NOMINAL - rng.randint(0, 1), NOMINAL + rng.randint(0, 1)) for p in plan.parameters})
        asked = Controllability(plan, box)
        schedule = asked.strong_answer().schedule
        if schedule is None:
            continue
        stnu = asked.network.at(ends_of(box))
        for _ in range(10):
            times = {p: schedule.get(p, Fraction(0)) for p in stnu.executable}
            for link in stnu.contingents:
                share = Fraction(rng.randint(0, 10), 10)
                times[link.target] = times[link.source] + link.lower + (link.upper - link.lower) * share
            assert all(link.holds(times) for link in stnu.links if isinstance(link, RequirementLink)), seed
        suited += 1
    assert suited > 20


# -- recorded plans --------------------------------------------------------------------------------------------------


def test_smallest_recorded_plans(dataset):
    instances = json.loads((dataset / "robot-delivery" / "instances.json").read_text())[:3]
    for instance in instances:
        plan = robust.load_plan(*(dataset / instance[key] for key in ("domain", "problem", "plan")))
        box = robust.envelope(plan).box
        assert verdicts(plan, box) == (YES, YES, YES)


def test_recorded_boxes_with_rigid_plans(dataset):
    """A start that has to follow an end at once is seen in time, but in no timetable."""
    recorded = json.loads((dataset / "recorded-results.json").read_text())
    for instance in (one for one in recorded if one["plan"].startswith("auv/")):
        plan = robust.load_plan(*(dataset / instance[key] for key in ("domain", "problem", "plan")))
        box = Box({name: Interval(Fraction(low), Fraction(high)) for name, (low, high) in instance["irr_box"].items()})
        assert verdicts(plan, box) == (YES, YES, NO)
        assert shrink(plan, box, Kind.STRONG) == Box.nominal(plan.parameters)
