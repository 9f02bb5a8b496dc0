"""Whether what a certificate says is true, by a solver and by this package's own methods."""

from __future__ import annotations

import json
from fractions import Fraction

from robust.api import check, region
from robust.certify.circuit import Atom, Circuit, Conjunction
from robust.certify.document import _literal, _node
from robust.certify.ground import GroundPlan
from robust.certify.witness import Witnesses
from robust.encode import create_encoding
from robust.errors import UnsupportedError
from robust.irr.check import Answer
from robust.qe.box import Box, Interval
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms
from tests.certify import tools


class Judge:
    """Judges certificates about one plan, or about a plan with choices if it is None; equal claims are judged once."""

    def __init__(self, plan) -> None:
        self._plan = plan
        self._formulas: dict[str, bool] = {}
        self._claims: dict[str, bool] = {}

    def judge(self, path, what: str) -> None:
        """The formulas of a certificate have no model, as a solver says, too."""
        lines = tools.lines_of(path)
        kinds = ("a", "g", "obligation", "root")
        stated = [line for line in lines[1:] if line[0] in kinds]
        key = json.dumps(stated)
        if key not in self._formulas:
            self._formulas[key] = formulas_are_unsatisfiable(stated)
        assert self._formulas[key], f"{what}: a formula has a model"

    def judge_claim(self, path, what: str) -> None:
        """What a certificate says of the plan is true."""
        if self._plan is None:
            return
        header, *lines = tools.lines_of(path)
        pieces = [line for line in lines if line[0] == "piece"]
        key = json.dumps([header["kind"], header.get("box"), header["encoding"], header["epsilon"], pieces])
        if key not in self._claims:
            true = region_is_envelope(pieces, self._plan) if pieces else box_is_as_claimed(header, self._plan)
            self._claims[key] = true
        assert self._claims[key], f"{what}: the claim is false"


def formulas_are_unsatisfiable(lines) -> bool:
    """Whether a solver agrees that each formula has no model: lines of nodes, obligations and roots."""
    nodes: list[int] = [0]
    circuit = Circuit()
    formulas: list[list[int]] = []
    for kind, *rest in lines:
        if kind == "obligation":
            formulas.append([])
        elif kind == "root":
            formulas[-1].append(_literal(nodes, rest[0]))
        else:
            nodes.append(_node(circuit, nodes, kind, rest))
    terms = Terms()
    built: dict[int, Formula] = {}
    for literals in formulas:
        session = Session(terms)
        session.add(*(_formula(terms, circuit, literal, built) for literal in literals))
        if session.check("a formula of a certificate") is not Verdict.UNSATISFIABLE:
            return False
    return True


def _formula(terms, circuit, literal, built):
    number = abs(literal)
    if number not in built:
        node = circuit.node(number)
        parts = [_formula(terms, circuit, each, built) for each in getattr(node, "inputs", ())]
        manager = terms.manager
        match node:
            case Atom(coefficients, strict, bound):
                total = manager.Plus([manager.Times(terms.number(Fraction(f)), terms.real(n)) for n, f in coefficients])
                built[number] = (manager.LT if strict else manager.LE)(total, terms.number(Fraction(bound)))
            case Conjunction():
                built[number] = terms.conjunction(parts)
    return built[number] if literal > 0 else terms.negation(built[number])


def box_is_as_claimed(header, plan) -> bool:
    """Whether the plan is valid all over the box, and no valid box contains it, if that is claimed."""
    ends = zip(header["parameters"], header["box"], strict=True)
    box = Box(
        {
            name: Interval(_end(low), _end(high), low_closed, high_closed)
            for (name, *_), (low, low_closed, high, high_closed) in ends
        }
    )
    if check(plan, at=box.intervals).answer is not Answer.PROVED:
        return False
    if header["kind"] == "maximal":
        try:
            list(Witnesses(create_encoding("relational", plan), GroundPlan(plan), box, deadline=Deadline()).lines())
        except UnsupportedError:
            return False
    return True


def _end(value):
    return None if value is None else Fraction(value)


def region_is_envelope(pieces, plan) -> bool:
    """Whether polyhedra are together the envelope that elimination finds."""
    names = tuple(parameter.name for parameter in plan.parameters)
    polyhedra = []
    for _, constraints in pieces:
        sides = []
        for expression, strict in constraints:
            factors = {term[1]: Fraction(term[0]) for term in expression if len(term) > 1}
            constant = sum((Fraction(term[0]) for term in expression if len(term) == 1), Fraction(0))
            sides.append(LinearConstraint.of(factors, ">" if strict else ">=", -constant))
        polyhedra.append(Polyhedron(names, tuple(sides)))
    return Region.union_of(names, polyhedra).equals(region(plan).region)
