"""Questions to encodings, and what their answers have in common with each other and with simulations."""

from collections.abc import Iterable, Mapping
from fractions import Fraction
from itertools import product
from random import Random
from typing import Any

import z3

from robust import Answer, Box, CheckResult, check
from robust.encode import create_encoding
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import EPSILON, Encoding, Facet, Grid, Obligation, Range
from robust.encode.positions import PositionsEncoding
from robust.irr.containment import Containment
from robust.plan.model import ParametrizedPlan, TimePoint
from robust.smt.limits import NEVER
from robust.smt.session import Formula, Satisfiability, Session
from tests.sampling import Network


def refuted(result: CheckResult) -> list[str]:
    """The obligations that break, each with a counterexample."""
    broken = [name for name, answer in result.obligations.items() if answer is Answer.REFUTED]
    assert broken == list(result.counterexamples)
    assert Answer.UNKNOWN not in result.obligations.values()
    return broken


def first_broken(plan: ParametrizedPlan, broken: Iterable[str]) -> list[str]:
    """Those of the earliest stage: later ones say nothing of the only schedule if an earlier one excludes it."""
    stage = {obligation.name: obligation.stage.value for obligation in RelationalEncoding(plan).obligations}
    earliest = min((stage[name] for name in broken), default=None)
    return [name for name in stage if name in broken and stage[name] == earliest]


Point = tuple[Mapping[str, Fraction], Mapping[TimePoint, Fraction]]  # values of parameters, and a schedule


def where_broken(encoding: PositionsEncoding, obligation: Obligation, points: Iterable[Point]) -> list[bool]:
    """Whether the encoding says that an obligation breaks, at each point."""
    terms, answers = encoding.terms, []
    session = Session(terms)
    session.add(*encoding.query(obligation))
    unknowns = set().union(*(place.variables for place in encoding.network.places.values()))
    symbols = {symbol.symbol_name(): symbol for symbol in encoding.unknowns()}
    for values, schedule in points:
        known = {**values, **{f"t({point})": time for point, time in schedule.items()}}
        pairs = [(terms.real(unknown), known[str(unknown)]) for unknown in unknowns]
        pairs += [(symbols[name], value) for name, value in values.items()]
        with session.frame(*(terms.manager.Equals(symbol, terms.number(value)) for symbol, value in pairs)):
            verdict = session.check(obligation.name)
        assert verdict is not Satisfiability.UNKNOWN
        answers.append(verdict is Satisfiability.SATISFIABLE)
    return answers


def follows(encoding: Encoding, facet: Facet, ranges: Mapping[str, Range]) -> None:
    """A facet of the network is broken somewhere in the box, and every schedule keeps it."""
    assert facet.breaks_in(Grid(ranges))
    assert facet.obligation is None
    assert facet.origins
    session = Session(encoding.terms)
    session.add(*encoding.network_formulas(), encoding.terms.greater(-facet.expression))
    assert session.check("a facet follows from the network") is Satisfiability.UNSATISFIABLE


def in_z3(encoding: Encoding, formulas: Iterable[Formula]) -> Any:
    solver = encoding.terms.environment.factory.Solver(name="z3", logic="QF_LRA")
    converted = [solver.converter.convert(formula) for formula in formulas]
    return z3.And(*(z3.BoolRef(c) if isinstance(c, z3.Ast) else c for c in converted))


def hidden(encoding: Encoding, formulas: Iterable[Formula]) -> list[Any]:
    """The symbols of the formulas other than parameters, as z3 constants."""
    names = set(encoding.plan.nominal)
    symbols = {symbol for formula in formulas for symbol in encoding.terms.variables(formula)}
    return [
        (z3.Bool if symbol.symbol_type().is_bool_type() else z3.Real)(symbol.symbol_name())
        for symbol in sorted(symbols, key=lambda symbol: symbol.symbol_name())
        if symbol.symbol_name() not in names
    ]


def unless_hidden(encoding: Encoding, formulas: Iterable[Formula]) -> Any:
    """No values of the symbols other than parameters satisfy the formulas."""
    body, bound = z3.Not(in_z3(encoding, formulas)), hidden(encoding, formulas)
    return z3.ForAll(bound, body) if bound else body


def difference(left: Encoding, right: Encoding) -> Satisfiability:
    """Parameter values with a schedule for which only the left encoding says that an obligation can break."""
    network, bad_left = left.network_formulas(), [left.query(o) for o in left.obligations]
    bad_right = [right.query(o) for o in right.obligations]
    never = [unless_hidden(right, query) for query in bad_right]
    solver = z3.Tactic("qsat").solver()
    solver.set("timeout", 10_000)
    solver.add(in_z3(left, network), z3.Or(*(in_z3(left, query) for query in bad_left)), *never)
    return Satisfiability({"sat": "sat", "unsat": "unsat"}.get(str(solver.check()), "unknown"))


def both(plan: ParametrizedPlan, epsilon: Fraction = Fraction(1, 1000)) -> tuple[Encoding, Encoding]:
    return create_encoding("relational", plan, epsilon), create_encoding("positions", plan, epsilon)


FAR = Fraction(50)  # stands for an infinite end; bounds and factors of drawn networks are much smaller


def sampled(ranges: Mapping[str, Range], random: Random, count: int) -> list[dict[str, Fraction]]:
    """Corners (far out where the box is infinite), the middle, and points in between."""
    ends = {name: _ends(*pair) for name, pair in ranges.items()}
    corners = [dict(zip(ends, corner, strict=True)) for corner in product(*ends.values())]
    middle = {name: (low + high) / 2 for name, (low, high) in ends.items()}
    inside = [
        {name: low + (high - low) * Fraction(random.randint(0, 16), 16) for name, (low, high) in ends.items()}
        for _ in range(count)
    ]
    return [*corners, middle, *inside]


def _ends(low: Fraction | None, high: Fraction | None) -> tuple[Fraction, Fraction]:
    low = low if low is not None else (high if high is not None else Fraction(0)) - FAR
    return low, high if high is not None else low + 2 * FAR


class Judge:
    """Whether boxes are inside the envelope, without the encoding that searches for boxes.

    The positions encoding decides. What it refutes, shortest paths confirm by values that leave no schedule, or the
    simulator by a schedule that breaks the plan.
    """

    def __init__(self, plan: ParametrizedPlan, epsilon: Fraction = EPSILON) -> None:
        self.plan, self.epsilon = plan, epsilon
        self._asked = Containment(PositionsEncoding(plan, epsilon))

    def contains(self, box: Box) -> bool:
        refutation = self._asked.refute(box, NEVER)
        if refutation is None:
            return True
        assert refutation.values in box
        if Network(self.plan, refutation.values).consistent:
            result = check(self.plan, at=refutation.values, encoding="positions", epsilon=self.epsilon)
            assert any(not broken.simulation.valid for broken in result.counterexamples.values()), refutation
        return False
