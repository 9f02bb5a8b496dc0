"""Small plans that have what the shipped ones lack: flexible times, infinite and open ends, every kind of condition."""

from __future__ import annotations

from fractions import Fraction

import pytest

from robust.api import envelope, region
from robust.certify.circuit import Circuit, Translator
from robust.certify.document import mismatch
from robust.certify.exactness import halved
from robust.certify.ground import GroundPlan, LongestPaths, cycle_sum, length_of, positive_cycle
from robust.certify.produce import PlanCertificate, schedule_over
from robust.certify.verify import export
from robust.encode.encoding import RelationalEncoding
from robust.errors import RefutedError
from robust.plan.model import ZERO, And, Holds, Or, Parameter, ParametrizedPlan, TimedLiteral
from robust.qe.box import Box, Interval
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.terms import Terms
from tests.certify import tools
from tests.plan import building
from tests.plan.building import DURATION, END, F, G, P, Q, above, action, at_least, between, increase, number, plan_of

K = building.reference("k")


def lasting(first: tuple, length: tuple, last: tuple, *pieces) -> ParametrizedPlan:
    """i starts, lasts and ends between two bounds each; the parameter is 1."""
    i = action("i", *pieces)
    constraints = (between(ZERO, i.start, *first), between(i.start, i.end, *length), between(ZERO, i.end, *last))
    return plan_of(i, parameters=(Parameter("k", Fraction(1)),), constraints=constraints)


ONE = number(1)
FLEXIBLE = lasting((K,), (1,), (None, K + 2))
MIRRORED = lasting((-K,), (1,), (None, number(2) - K))
LATE = lasting((K,), (1,), (None, 5))
BELOW = lasting((1, 1), (K, 8), (), (END, at_least(number(9) - DURATION, K)), (END, at_least(8, DURATION)))
OPEN = lasting((1, 1), (K, K), (), (END, above(8, DURATION)))
SEPARATED = lasting((1, 1), (K, K), (), increase(F, 1), (END, at_least(building.value(F), 1)))


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
@pytest.mark.parametrize(
    ("plan", "box", "found"),
    [
        (FLEXIBLE, "k ∈ [-1, inf)", {"cycle"}),
        (MIRRORED, "k ∈ (-inf, 1]", {"cycle"}),
        (LATE, "k ∈ (-inf, 4]", {"cycle"}),
        (BELOW, "k ∈ [0, 1]", {"witness", "w", "n", "t"}),
        (OPEN, "k ∈ [0, 8)", {"witness", "w", "t"}),
        (SEPARATED, "k ∈ [1/1000, inf)", {"witness", "w", "t"}),
    ],
    ids=["flexible", "mirrored", "late", "below", "open", "separated"],
)
def test_small_plans_are_certified(tmp_path, plan, box, found, solver) -> None:
    path = tmp_path / "made.cert"
    widest = envelope(plan).box
    assert str(widest) == box
    encoding, deadline = RelationalEncoding(plan), Deadline.after(60)
    options = {"inputs": {}, "solver": solver, "deadline": deadline}
    made = PlanCertificate(encoding, kind="maximal", box=widest, **options)
    made.add_box()
    made.add_witnesses()
    made.writer.save(path)
    assert (tools.rejection(path), mismatch(path, plan, deadline)) == (None, None)
    lines = tools.lines_of(path)[1:]
    kinds = {line[2] if line[0] == "root" else line[0] for line in lines}
    separations = [line[5:] for line in lines if line[0] == "witness" and line[5] == "separation"]
    assert separations == ([["separation", 1, 2]] if plan is SEPARATED else [])
    assert kinds & {"cycle", "witness", "w", "n", "t"} == found
    whole = PlanCertificate(encoding, kind="region", **options)
    whole.add_region(region(plan).region)
    whole.writer.save(path)
    assert (tools.rejection(path), mismatch(path, plan, deadline)) == (None, None)


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
@pytest.mark.parametrize(("low", "high"), [(-1, 5), (0, 5), (2, None), (-1, None)])
@pytest.mark.parametrize(("plan", "sign"), [(FLEXIBLE, 1), (MIRRORED, -1)], ids=["flexible", "mirrored"])
def test_schedules_over_boxes(plan, sign, low, high, solver) -> None:
    """No constant times suit any of the boxes."""
    ends = [None if end is None else Fraction(end * sign) for end in (low, high)][::sign]
    times = schedule_over(GroundPlan(plan), {"k": tuple(ends)}, solver=solver, deadline=Deadline.after(60))
    for least in (low, 2, 3, high or 1000):
        values = {unknown: Fraction(least * sign) for time in times for unknown in time.variables}
        zero, start, end = (time.evaluate(values) for time in times)
        assert zero == 0 <= start
        assert least <= start <= end - 1 <= least + 1


def test_ground_plans_as_certificates_state_them() -> None:
    """Every kind of condition and effect; times are `@` and their number, constraints lower bounds of differences."""
    f = building.value(F)
    either = Or((Holds(P, True), And((Holds(Q, False), above(f, K)))))
    given = ((building.START, either), (building.ALL, at_least(f, 0)))
    atoms = (building.add(Q, END, Holds(P, True)), building.delete(P))
    i = action("i", *given, *atoms, increase(F, DURATION, END), building.assign(G, K), building.flow(G, 2))
    constraints = (between(ZERO, i.start, 1, K), between(i.start, i.end, K, K))
    literals = (TimedLiteral(Fraction(3, 2), Q, False), TimedLiteral(Fraction(3), F, Fraction(1, 2)))
    parameters = (Parameter("k", Fraction(2)),)
    fluents = {"f": K + 1, "goal": Holds(Q, True)}
    plan = plan_of(i, atoms=(P,), **fluents, literals=literals, parameters=parameters, constraints=constraints)
    duration = [[1, "@2"], [-1, "@1"]]
    part = ["or", ["h", "(p)", True], ["and", ["h", "(q)", False], ["c", [[1, "(f)"], [-1, "k"]], ">"]]]
    assert list(GroundPlan(plan).lines()) == [
        ["point", "i.start"],
        ["point", "i.end"],
        ["point", "@3/2", True],
        ["point", "@3", True],
        ["constraint", 0, 3, [["3/2"]]],
        ["constraint", 3, 0, [["-3/2"]]],
        ["constraint", 0, 4, [[3]]],
        ["constraint", 4, 0, [[-3]]],
        ["constraint", 0, 1, [[1]]],
        ["constraint", 1, 0, [[-1, "k"]]],
        ["constraint", 1, 2, [[1, "k"]]],
        ["constraint", 2, 1, [[-1, "k"]]],
        ["initial", ["(p)"], [["(f)", [[1, "k"], [1]]], ["(g)", []]]],
        ["condition", 1, None, ["c", duration, ">="], "i act: non-negative duration"],
        ["condition", 1, None, part, "i act: at start c0"],
        ["condition", 1, 2, ["c", [[1, "(f)"]], ">="], "i act: over all c1"],
        ["condition", None, None, ["h", "(q)", True], "goal: goal"],
        ["effect", 2, "add", "(q)", [], ["h", "(p)", True]],
        ["effect", 1, "delete", "(p)", [], True],
        ["effect", 2, "increase", "(f)", duration, True],
        ["effect", 1, "assign", "(g)", [[1, "k"]], True],
        ["rate", 1, 2, "(g)", [[2]]],
        ["effect", 3, "delete", "(q)", [], True],
        ["effect", 4, "assign", "(f)", [["1/2"]], True],
        ["place", 3, [0, 1]],
        ["place", 4, [2, 3]],
        ["place", 1, "t(i.start)"],
        ["place", 2, [6, 7]],
    ]


def test_paths_of_the_network() -> None:
    ground = GroundPlan(LATE)
    paths = LongestPaths(ground, {"k": (Fraction(2), Fraction(3))})
    assert ground.edges == ((0, 1, K), (1, 2, ONE), (2, 0, number(-5)))
    assert [paths.between(0, 2, Fraction(distance)) for distance in (2, 3, 4)] == [[0, 1], [0, 1], None]
    assert (paths.between(2, 1, Fraction(-3)), paths.between(2, 1, Fraction(-2))) == ([2, 0], None)
    assert (paths.between(1, 1, Fraction(0)), paths.between(1, 1, Fraction(1))) == ([], None)
    assert positive_cycle(ground, {"k": Fraction(4)}) is None
    cycle = positive_cycle(ground, {"k": Fraction(9, 2)})
    assert sorted(cycle) == [0, 1, 2]
    assert (cycle_sum(ground, cycle), length_of(ground, cycle, {"k": Fraction(9, 2)})) == (K - 4, Fraction(1, 2))


def test_sums_of_terms() -> None:
    terms = Terms()
    manager, x = terms.manager, terms.real("x")
    one, half_x = manager.Real(1), manager.Times(manager.Real(Fraction(1, 2)), x)
    total = manager.Plus([x, one, half_x, manager.Minus(one, x), manager.Real(3)])
    assert Translator(terms, Circuit()).linear(total) == ({"x": Fraction(1, 2)}, Fraction(5))


@pytest.mark.parametrize(
    ("sides", "turn", "middle"),
    [([], 3, 0), ([(">=", 4)], 2, 8), ([("<=", 4)], 2, 0), ([(">=", 1), ("<=", 4)], 2, Fraction(5, 2))],
)
def test_halves_with_infinite_ends(sides, turn, middle) -> None:
    whole = Polyhedron(("x",), tuple(LinearConstraint.of({"x": 1}, relation, end) for relation, end in sides))
    below, over = (half.extent("x") for half in halved(whole, turn))
    assert (below.upper, below.upper_closed, over.lower, over.lower_closed) == (middle, True, middle, False)


def test_proofs_by_another_solver(tmp_path) -> None:
    encoding = RelationalEncoding(BELOW)
    inside = Box({"k": Interval(Fraction(0), Fraction(1))})
    assert export(encoding, inside, tmp_path / "proofs", Deadline.after(60)) >= 0
    with pytest.raises(OutOfTimeError):
        export(encoding, inside, tmp_path, Deadline.after(0))
    with pytest.raises(RefutedError, match="breaks for some of these values; expected values for which it holds"):
        export(encoding, Box({"k": Interval(Fraction(0), Fraction(2))}), tmp_path, Deadline())
