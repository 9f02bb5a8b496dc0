"""The elimination problems whose union is the complement of the robustness envelope.

`exists` says which parameter values leave a schedule; `violations` say, among those, which ones let some schedule break
an obligation. How they are grouped is the splitting:

- monolithic: the complement is one formula with both quantifiers;
- partial: existence is one problem, all obligations together are another;
- full: every obligation is a problem of its own, parameter-only ones first.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from graphlib import CycleError, TopologicalSorter

from robust.encode.interface import Encoding, Obligation
from robust.plan.model import ParametrizedPlan
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.conjunctions import Conjunction
from robust.qe.eliminate.interface import Definition, Query
from robust.qe.nnf import FALSE, TRUE, Junction, Nnf, Reader, conjunction, disjunction, names_in, negation
from robust.smt.session import Session, Verdict


class Splitting(Enum):
    MONOLITHIC = "monolithic"
    PARTIAL = "partial"
    FULL = "full"


@dataclass(frozen=True)
class Problem:
    """What is to be eliminated for one plan.

    `bounds` are the declared parameter bounds as a conjunction, `exists` is the query of enc_valid, and the union of
    `violations` and of its complement is the bad set.
    """

    parameters: tuple[str, ...]
    bounds: Conjunction
    exists: Query
    violations: tuple[Query, ...]


class ProblemBuilder:
    """Builds queries from an encoding.

    Args:
        encoding: the plan's formulas.
        reader: of the encoding's terms.
        session: an empty session over these terms, for the examination of definitions.
    """

    def __init__(self, encoding: Encoding, reader: Reader, session: Session) -> None:
        self._encoding = encoding
        self._reader = reader
        self._session = session
        self._kept = tuple(parameter.name for parameter in encoding.plan.parameters)
        self._unknowns = {symbol.symbol_name() for symbol in encoding.unknowns()} | set(self._kept)
        self._defined: dict[Nnf, Mapping[str, bool]] = {}

    def build(self, splitting: Splitting) -> Problem:
        """The problems of a splitting, quickest first."""
        queries = [
            self.query(obligation)
            for obligation in self._encoding.obligations
            if obligation.violation is not self._encoding.terms.false
        ]
        if splitting is not Splitting.FULL:
            queries = [merged("all obligations", self._kept, queries)] if queries else []
        queries.sort(key=lambda query: len(query.eliminated))
        return Problem(self._kept, declared_bounds(self._encoding.plan), self.existence(), tuple(queries))

    def existence(self) -> Query:
        """∃ times. enc_tn."""
        network = conjunction(map(self._reader.read, self._encoding.network_formulas()))
        constraints, rest = _inequalities([network])
        return Query("some schedule exists", self._kept, constraints, TRUE, (), rest)

    def query(self, obligation: Obligation) -> Query:
        """∃ times, auxiliaries. enc_tn ∧ enc_eff ∧ ¬P."""
        network: list[Nnf] = []
        others: list[Nnf] = []
        for formula in self._encoding.query(obligation):
            if formula is not obligation.violation:
                node = self._reader.read(formula)
                (network if names_in(node) <= self._unknowns else others).append(node)
        constraints, rest = _inequalities(network)
        definitions, undefined = self._definitions(others)
        violation = self._reader.read(obligation.violation)
        return Query(obligation.name, self._kept, constraints, violation, definitions, conjunction((rest, *undefined)))

    def _definitions(self, formulas: Iterable[Nnf]) -> tuple[tuple[Definition, ...], list[Nnf]]:
        """Tell apart definitions of single symbols that can always be satisfied, without circles, and the rest."""
        open_ = {formula: [n for n, total in self._candidates(formula).items() if total] for formula in formulas}
        found: dict[str, Nnf] = {}
        while unique := [(formula, names[0]) for formula, names in open_.items() if len(names) == 1]:
            for formula, name in unique:
                if name not in found:
                    found[name] = formula
                del open_[formula]
            open_ = {formula: [n for n in names if n not in found] for formula, names in open_.items()}
        depends = {name: names_in(formula) & found.keys() - {name} for name, formula in found.items()}
        try:
            order = list(TopologicalSorter(depends).static_order())
        except CycleError:
            order = []
        definitions = tuple(Definition(name, found[name]) for name in order)
        taken = {definition.formula for definition in definitions}
        return definitions, [formula for formula in formulas if formula not in taken]

    def _candidates(self, formula: Nnf) -> Mapping[str, bool]:
        """Symbols that the formula may define, and whether it does so whatever the other symbols are."""
        if formula not in self._defined:
            names = sorted(names_in(formula) - self._unknowns)
            cases = {name: _cases(formula, name) for name in names}
            self._defined[formula] = {
                name: self._is_total(name, found) for name, found in cases.items() if found is not None
            }
        return self._defined[formula]

    def _is_total(self, name: str, cases: list[tuple[Nnf, LinearConstraint]]) -> bool:
        """Whether cases that apply together agree."""
        clashes = []
        for index, (condition, value) in enumerate(cases):
            for other_condition, other_value in cases[:index]:
                factor = dict(value.coefficients)[name] / dict(other_value.coefficients)[name]
                gap = {n: c for n, c in value.coefficients if n != name}
                for n, c in other_value.coefficients:
                    if n != name:
                        gap[n] = gap.get(n, 0) - factor * c
                constant = value.constant - factor * other_value.constant
                equal = LinearConstraint(tuple(gap.items()), value.relation, constant)
                clashes.append(conjunction((condition, other_condition, negation(equal))))
        clash = disjunction(clashes)
        if clash is FALSE:
            return True
        with self._session.frame(self._reader.write(clash)):
            return self._session.check(f"definition of {name}") is Verdict.UNSATISFIABLE


def declared_bounds(plan: ParametrizedPlan) -> Conjunction:
    """The declared parameter bounds."""
    bounds = []
    for parameter in plan.parameters:
        if parameter.lower is not None:
            bounds.append(LinearConstraint.of({parameter.name: 1}, ">=", parameter.lower))
        if parameter.upper is not None:
            bounds.append(LinearConstraint.of({parameter.name: 1}, "<=", parameter.upper))
    return tuple(bounds)


def merged(name: str, kept: tuple[str, ...], queries: Iterable[Query]) -> Query:
    """The disjunction of several queries; definitions stay apart, because they can always be satisfied."""
    queries = list(queries)
    violation = disjunction(conjunction((*q.network, q.violation, q.remainder)) for q in queries)
    definitions = {d.formula: d for query in queries for d in query.definitions}
    symbols = [definition.symbol for definition in definitions.values()]
    if len(set(symbols)) == len(symbols):
        depends = {d.symbol: (names_in(d.formula) & set(symbols)) - {d.symbol} for d in definitions.values()}
        by_symbol = {d.symbol: d for d in definitions.values()}
        try:
            ordered = tuple(by_symbol[symbol] for symbol in TopologicalSorter(depends).static_order())
            return Query(name, kept, (), violation, ordered)
        except CycleError:
            pass
    return Query(name, kept, (), disjunction(query.formula for query in queries))


def _inequalities(formulas: Iterable[Nnf]) -> tuple[Conjunction, Nnf]:
    """The constraints of a conjunction, and what is not one."""
    whole = conjunction(formulas)
    parts = whole.operands if isinstance(whole, Junction) and whole.conjunctive else (whole,)
    constraints = tuple(part for part in parts if isinstance(part, LinearConstraint))
    return constraints, conjunction(part for part in parts if not isinstance(part, LinearConstraint))


def _cases(formula: Nnf, name: str) -> list[tuple[Nnf, LinearConstraint]] | None:
    """The formula as a conjunction of implications `condition → name = value`, name nowhere else; None if it is not."""
    parts = formula.operands if isinstance(formula, Junction) and formula.conjunctive else (formula,)
    cases = []
    for part in parts:
        operands = part.operands if isinstance(part, Junction) else (part,)
        values = [o for o in operands if isinstance(o, LinearConstraint) and o.is_equality and name in o.parameters]
        rest = [operand for operand in operands if operand not in values]
        if len(values) != 1 or any(name in names_in(operand) for operand in rest):
            return None
        cases.append((negation(disjunction(rest)), values[0]))
    return cases
