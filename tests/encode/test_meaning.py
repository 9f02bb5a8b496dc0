"""What plans mean in both encodings, case by case [docs/semantics.md]; over-all conditions where they are delicate."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction

import pytest

from robust.api import check, envelope
from robust.backends import ENCODINGS
from robust.encode import create_encoding
from robust.encode.positions.encoding import PositionsEncoding
from robust.errors import InputError, UnsupportedError
from robust.irr.check import Answer
from robust.plan.model import ZERO, And, Holds, Or, Parameter, ParametrizedPlan, TimedLiteral
from robust.plan.simulate import simulate
from robust.probability.risk import METHODS
from robust.searching import Status
from robust.smt.limits import Deadline, OutOfTimeError
from tests.children import interrupted_after
from tests.encode.asking import first_broken, refuted
from tests.plan import building
from tests.plan.building import START, F, G, P, action, at, at_least, between, flow, increase, instant, plan_of, value

by_both = pytest.mark.parametrize("encoding", ENCODINGS)
f = value(F)
ALL, END, Q, UP = building.ALL, building.END, building.Q, building.UP
ADDER, DELETER, READER = instant("a", building.add(P)), instant("d", building.delete(P)), action("r", (ALL, Holds(P)))
USER, FLOWING = instant("u", (START, Holds(P))), action("r", flow(F, 1))
FIXES = (building.pinned, building.windows)
TWO_SIDED = Or((building.STRICT, building.above(-f, 0)))


def broken(plan: ParametrizedPlan, encoding: str, **values: int) -> list[str]:
    return refuted(check(plan, encoding=encoding, every=True, at={n: Fraction(v) for n, v in values.items()}))


# A rate that is a parameter needs a schedule without time variables.
FIXED = [(one, fix) for one in building.EXAMPLES for fix in FIXES if fix is FIXES[0] or not one.parameters]


@by_both
@pytest.mark.parametrize(("example", "fix"), FIXED, ids=[f"{one.name}, {fix.__name__}" for one, fix in FIXED])
def test_examples(example, fix, encoding) -> None:
    plan = fix(example.plan, building.schedule_of(example.plan, example.times))
    labels = [one if isinstance(one, str) else one.obligation for one in example.broken]
    assert broken(plan, encoding, **example.parameters) == first_broken(plan, labels)


@by_both
def test_obligations_have_names_and_an_order(encoding) -> None:
    plan = plan_of(action("a", (START, Holds(P)), (ALL, Holds(P)), building.add(Q)), atoms=(P,), goal=Holds(Q))
    names = ["a act: non-negative duration", "a act: at start c0", "a act: over all c1", "goal: goal"]
    created = create_encoding(encoding, plan, Fraction(1, 2))
    assert (created.name, created.epsilon) == (encoding, Fraction(1, 2))
    assert [one.name for one in created.obligations] == names
    assert check(plan, encoding=encoding).answer is Answer.REFUTED
    result = envelope(plan, encoding=encoding)
    assert (result.encoding, result.status) == (encoding, Status.INVALID)
    with pytest.raises(InputError, match=f"unknown encoding '{encoding[:-1]}'; did you mean '{encoding}'"):
        create_encoding(encoding[:-1], plan)


# -- unordered time points and continuous change ---------------------------------------------------------------------

KEPT = (at(ADDER.start, 1), between(ADDER.start, READER.start, 1, 5), between(READER.start, READER.end, 1, 5))
WINDOW = (TimedLiteral(Fraction(2), P, True), TimedLiteral(Fraction(4), P, False))
SUM = f + value(G)
CIRCLE = (instant("a", increase(F, value(G))), instant("b", increase(G, value(F))))
SECOND = instant("b", building.add(Q, condition=Holds(P)))
AFTER = (at(ADDER.start, 1), between(ADDER.start, SECOND.start, 1))
AROUND = (at(ADDER.start, 1), between(ZERO, SECOND.start, 0, 2))
SLOW, FAST = action("a", flow(F, 1)), action("b", flow(F, 2))
OVERLAP = (at(SLOW.start, 1), at(SLOW.end, 5), between(ZERO, FAST.start, 2, 3), between(FAST.start, FAST.end, 1, 1))
RESET = instant("s", building.assign(F, 10))
RESTARTED = (at(FLOWING.start, 1), at(FLOWING.end, 6), between(ZERO, RESET.start, 3, 4))
LASTING = action("r", (END, at_least(4, building.DURATION)), increase(F, building.DURATION, END))
FREE = (between(ZERO, USER.start, 3, 5),)


@by_both
@pytest.mark.parametrize(
    ("instances", "constraints", "options", "expected"),
    [
        ((ADDER, DELETER), (between(DELETER.start, ADDER.start, 1),), {"goal": Holds(P)}, []),
        ((ADDER, DELETER), (), {"goal": Holds(P)}, ["separation: a, d", "goal: goal"]),
        ((ADDER, READER, DELETER), (*KEPT, at(DELETER.start, 9)), {}, ["r act: over all c0"]),
        ((ADDER, READER, DELETER), (*KEPT, at(DELETER.start, 11)), {}, []),
        ((USER,), (at(USER.start, 3),), {"literals": WINDOW}, []),
        ((USER,), FREE, {"literals": WINDOW}, ["separation: u, @4", "u act: c0"]),
        ((ADDER, SECOND), AFTER, {"goal": Holds(Q)}, []),
        ((ADDER, SECOND), AROUND, {"goal": Holds(Q)}, ["separation: a, b", "goal: goal"]),
        (CIRCLE, (), {"f": 1, "g": 1, "goal": And((at_least(SUM, 4), building.at_most(SUM, 5)))}, ["separation: a, b"]),
        ((ADDER, USER), (between(ADDER.start, USER.start, 0, 2),), {}, ["separation: a, u"]),
        ((SLOW, FAST), OVERLAP, {"goal": building.equal(f, 6)}, []),
        ((FLOWING, RESET), RESTARTED, {"goal": And((at_least(f, 12), building.at_most(f, 13)))}, []),
        ((FLOWING, RESET), RESTARTED, {"goal": at_least(f, 13)}, ["goal: goal"]),
        (
            (LASTING,),
            (between(LASTING.start, LASTING.end, 2, 5),),
            {"goal": at_least(f, 3)},
            ["r act: at end c0", "goal: goal"],
        ),
    ],
)
def test_unordered_points_are_tried_in_every_order(instances, constraints, options, expected, encoding) -> None:
    assert broken(plan_of(*instances, constraints=constraints, **options), encoding) == expected


@by_both
def test_a_rate_may_be_a_parameter_where_elapsed_times_are_fixed(encoding) -> None:
    run, read = action("r", flow(F, building.reference("k"))), instant("x", (START, building.at_most(f, 4)))

    def plan(latest: int) -> ParametrizedPlan:
        times = (at(run.start, 1), at(run.end, 6), between(ZERO, read.start, 3, latest))
        parameters = (Parameter("k", Fraction(1)),)
        return plan_of(run, read, constraints=times, goal=building.at_most(f, 10), parameters=parameters)

    assert broken(plan(3), encoding, k=2) == []
    assert broken(plan(3), encoding, k=3) == ["x act: c0", "goal: goal"]
    with pytest.raises(UnsupportedError, match="rate k times an elapsed time that is not constant"):
        broken(plan(4), encoding)


@by_both
@pytest.mark.parametrize(
    ("plan", "error", "message"),
    [
        (
            plan_of(action("r", flow(F, value(G))), instant("w", increase(G, 1)), goal=at_least(f, 0)),
            UnsupportedError,
            r"its rate reads \(g\), which the plan changes",
        ),
        (
            plan_of(instant("i", (START, at_least(f, 0)), increase(F, 1)), f=None),
            InputError,
            r"\(f\) has no initial value",
        ),
    ],
)
def test_what_is_not_supported(plan, error, message, encoding) -> None:
    with pytest.raises(error, match=message):
        broken(plan, encoding)


# -- over-all conditions ---------------------------------------------------------------------------------------------

# Mutex time points happen at once in some of the cases, so separation is 0 there.
TOUCHING = Fraction(0)


@pytest.mark.parametrize(("encoding", "solver"), [("relational", "z3"), ("relational", "cvc5"), ("positions", "z3")])
@pytest.mark.parametrize("fix", FIXES)
@pytest.mark.parametrize("case", building.OVER_ALL, ids=[case.name for case in building.OVER_ALL])
def test_delicate_conditions(case, fix, encoding, solver) -> None:
    plan, times = building.delicate(case)
    fixed = fix(plan, building.schedule_of(plan, times))
    result = check(fixed, epsilon=TOUCHING, encoding=encoding, solver=solver, every=True)
    assert result.obligations["i act: over all c0"] is (Answer.PROVED if case.holds else Answer.REFUTED)


@pytest.mark.parametrize("condition", [Holds(P), building.STRICT, building.different(f, 0), TWO_SIDED])
def test_nothing_lies_inside_an_action_of_no_duration(condition) -> None:
    plan = plan_of(action("i", (ALL, condition)), UP)
    schedule = building.schedule_of(plan, {"i": (3, 3), "u": (3, 5)})
    assert simulate(plan, {}, schedule).valid
    for fix in FIXES:
        assert check(fix(plan, schedule)).answer is Answer.PROVED


@pytest.mark.parametrize(
    ("condition", "ends"),
    [
        (building.STRICT, {Fraction(2): Answer.REFUTED}),
        *(
            (condition, {Fraction(5): Answer.PROVED, Fraction(51, 10): Answer.REFUTED})
            for condition in (building.different(f, 0), TWO_SIDED, Holds(P))
        ),
    ],
)
def test_what_changes_with_the_schedule_is_seen(condition, ends) -> None:
    """u may start any time from 2 to 4, its limit falls inside i or not, so does the literal."""
    i = action("i", (ALL, condition))
    for end, answer in ends.items():
        times = (at(i.start, 1), at(i.end, end), between(ZERO, UP.start, 2, 4), between(UP.start, UP.end, 6, 6))
        literals = (TimedLiteral(Fraction(5), P, False),)
        plan = plan_of(i, UP, atoms=(P,), f=-3, literals=literals, constraints=times)
        assert check(plan).answer is answer


# -- time limits and Ctrl-C end the positions encoding cleanly, while building formulas and while solving them ---------


def unordered(count: int) -> ParametrizedPlan:
    """Increases in any order below a cap: far too many orders to search, and very many formulas."""
    watcher = action("w", (ALL, building.at_most(value(F), count)))
    steps = [instant(f"i{n}", increase(F, 1)) for n in range(count)]
    constraints = (at(watcher.start, 0), at(watcher.end, 50), *(between(ZERO, step.start, 1, 40) for step in steps))
    parameters = (Parameter("k", Fraction(1)),)
    return plan_of(watcher, *steps, constraints=constraints, goal=at_least(value(F), count), parameters=parameters)


SOLVING, BUILDING = unordered(11), unordered(70)


@contextmanager
def soon() -> Iterator[None]:
    started = time.monotonic()
    yield
    assert time.monotonic() - started < 15


def test_building_polls_the_deadline() -> None:
    encoding = PositionsEncoding(BUILDING, deadline=Deadline.after(0.2))
    with soon(), pytest.raises(OutOfTimeError):
        encoding.query(encoding.obligations[-1])


of_finalisers = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


@of_finalisers
@pytest.mark.parametrize("plan", [SOLVING, BUILDING])
def test_the_verdict_is_left_open(plan: ParametrizedPlan) -> None:
    with soon():
        result = check(plan, encoding="positions", timeout=0.3)
    assert (result.answer, result.interrupted) == (Answer.UNKNOWN, False)
    with soon(), interrupted_after(0.4):
        result = check(plan, encoding="positions", timeout=60)
    assert (result.answer, result.interrupted) == (Answer.UNKNOWN, True)


@of_finalisers
@pytest.mark.parametrize("method", METHODS)
def test_the_search_for_a_box_ends(method: str) -> None:
    with soon():
        assert envelope(BUILDING, method=method, encoding="positions", timeout=0.3).status is Status.TIMEOUT
    with soon(), interrupted_after(0.4):
        assert envelope(BUILDING, method=method, encoding="positions", timeout=30).status is Status.INTERRUPTED
