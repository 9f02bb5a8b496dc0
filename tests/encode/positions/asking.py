"""Questions to both encodings in the form that their comparison needs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

import z3

from robust.encode import create_encoding
from robust.encode.interface import Encoding, Obligation
from robust.encode.positions.encoding import PositionsEncoding
from robust.plan.model import ParametrizedPlan, TimePoint
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula


def is_broken(
    encoding: PositionsEncoding,
    obligation: Obligation,
    parameters: Mapping[str, Fraction],
    schedule: Mapping[TimePoint, Fraction],
) -> bool:
    """Whether the encoding says that one schedule breaks an obligation."""
    terms = encoding.terms
    session = Session(terms)
    session.add(*encoding.query(obligation))
    for unknown in {unknown for place in encoding.network.place.values() for unknown in place.variables}:
        known = parameters | {f"t({point})": time for point, time in schedule.items()}
        session.add(terms.manager.Equals(terms.real(unknown), terms.number(known[str(unknown)])))
    for name, value in parameters.items():
        symbol = next(s for s in encoding.unknowns() if s.symbol_name() == name)
        session.add(terms.manager.Equals(symbol, terms.number(value)))
    verdict = session.check(obligation.name)
    assert verdict is not Verdict.UNKNOWN
    return verdict is Verdict.SATISFIABLE


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


def difference(left: Encoding, right: Encoding) -> Verdict:
    """Parameter values with a schedule for which only the left encoding says that an obligation can break."""
    network, bad_left = left.network_formulas(), [left.query(o) for o in left.obligations]
    bad_right = [right.query(o) for o in right.obligations]
    never = []
    for query in bad_right:
        body, bound = z3.Not(in_z3(right, query)), hidden(right, query)
        never.append(z3.ForAll(bound, body) if bound else body)
    solver = z3.Tactic("qsat").solver()
    solver.set("timeout", 10_000)
    solver.add(in_z3(left, network), z3.Or(*(in_z3(left, query) for query in bad_left)), *never)
    answer = solver.check()
    if answer == z3.unknown:
        return Verdict.UNKNOWN
    return Verdict.SATISFIABLE if answer == z3.sat else Verdict.UNSATISFIABLE


def both(plan: ParametrizedPlan, epsilon: Fraction = Fraction(1, 1000)) -> tuple[Encoding, Encoding]:
    return create_encoding("relational", plan, epsilon), create_encoding("positions", plan, epsilon)
