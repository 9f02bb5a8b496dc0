"""Schedules over a box, as expressions over the parameters: why some schedule exists for every value in it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

from robust.certify.circuit import Circuit, Conjunction, Translator, conjuncts
from robust.certify.document import CertificateWriter
from robust.certify.exactness import (
    Broken,
    Exactness,
    Form,
    Nowhere,
    combined,
    form_of,
    free_points,
    halves_of,
    literal_of,
    multiples,
    network_roles,
    ranges_of,
    scheduled,
    substituted,
    uncovered,
)
from robust.certify.ground import GroundPlan, Line, LongestPaths, number, optional
from robust.certify.refute import NotRefutedError, Refuter
from robust.certify.witness import Witnesses
from robust.encode.interface import Encoding, Obligation, Stage
from robust.encode.variables import Auxiliary, Linear, Range, TimeVariable, constant, least, variable
from robust.errors import RefutedError, UnsupportedError
from robust.plan.model import ParameterReference
from robust.qe.box import Box, Interval
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms

Times = dict[TimeVariable, Linear]
"""Free time points over the parameters."""


@dataclass(frozen=True, slots=True)
class Edge:
    """`t_target − t_source ≥ weight` between free time points; None is zero."""

    source: TimeVariable | None
    target: TimeVariable | None
    weight: Linear


def schedule_over(
    ground: GroundPlan,
    ranges: Mapping[str, Range],
    *,
    solver: str = "z3",
    deadline: Deadline = NEVER,
) -> list[Linear]:
    """A time for each time point, over the parameters, such that the network is kept all over the box.

    First free time points get constant times by Bellman–Ford with every bound at its worst; if that is not possible,
    times that are linear in the parameters, found by a solver.

    Args:
        ground: the plan.
        ranges: the box.
        solver: `z3` or `cvc5`.
        deadline: when to give up.

    Raises:
        UnsupportedError: if no such expressions exist, although each point of the box may have a schedule.
        OutOfTimeError: if the deadline passes.
    """
    edges = list(dict.fromkeys(_edges(ground)))
    free = [v for place in ground.places.values() for v in place.variables if isinstance(v, TimeVariable)]
    free = list(dict.fromkeys(free))
    times = _constant_times(free, edges, ranges)
    if times is None:
        times = _linear_times(free, edges, ranges, solver, deadline)
    return [_placed(ground.places[index], times) for index in sorted(ground.places)]


def _placed(place: Linear, times: Times) -> Linear:
    return place.substitute(lambda unknown: times[unknown] if isinstance(unknown, TimeVariable) else variable(unknown))


def _edges(ground: GroundPlan) -> Iterator[Edge]:
    zero = constant(0)
    statements = [(0, point, zero) for point in ground.places]
    statements += [side[1:] for bound in ground.bounds for side in bound.sides()]
    for source, target, distance in statements:
        expression = ground.places[target] - ground.places[source] - distance
        ends: dict[bool, TimeVariable] = {}
        weight = constant(-expression.constant_term)
        for unknown, factor in expression.coefficients():
            if isinstance(unknown, TimeVariable):
                ends[factor > 0] = unknown
            else:
                weight -= variable(unknown).scaled(factor)
        if ends:
            yield Edge(ends.get(False), ends.get(True), weight)


def _constant_times(free: Sequence[TimeVariable], edges: Sequence[Edge], ranges: Mapping[str, Range]) -> Times | None:
    """The earliest times that suit the worst weight of each edge; None if there are none."""
    worst = [(edge, least(-edge.weight, ranges)) for edge in edges]
    if any(floor is None for _, floor in worst):
        return None
    times: dict[TimeVariable | None, Fraction] = dict.fromkeys((None, *free), Fraction(0))
    for _ in range(len(times) + 1):
        changed = False
        for edge, floor in worst:
            reached = times[edge.source] - (floor or 0)
            if reached > times[edge.target]:
                if edge.target is None:
                    return None
                times[edge.target], changed = reached, True
        if not changed:
            return {point: constant(times[point]) for point in free}
    return None


def _linear_times(
    free: Sequence[TimeVariable],
    edges: Sequence[Edge],
    ranges: Mapping[str, Range],
    solver: str,
    deadline: Deadline,
) -> Times:
    """Times that are linear in the parameters: least values over the box are linear in the coefficients sought."""
    terms = Terms()
    names = list(ranges)
    unknowns = {
        point: [variable(Auxiliary("coefficient", index * (len(names) + 1) + place)) for place in range(len(names) + 1)]
        for index, point in enumerate(free)
    }
    conditions: list[Formula] = []
    shares = 0
    for edge in edges:
        total = constant(-edge.weight.constant_term)
        slopes = {name: constant(0) for name in names}
        for parameter, factor in edge.weight.coefficients():
            slopes[str(parameter)] -= factor
        for point, sign in ((edge.target, 1), (edge.source, -1)):
            if point is not None:
                total += unknowns[point][0].scaled(sign)
                for name, coefficient in zip(names, unknowns[point][1:], strict=True):
                    slopes[name] += coefficient.scaled(sign)
        for name, slope in ((name, slope) for name, slope in slopes.items() if slope != constant(0)):
            low, high = ranges[name]
            share = variable(Auxiliary("share", shares))
            shares += 1
            total += share
            for end, falling in ((low, slope), (high, -slope)):
                # Towards an infinite end the sum must not fall.
                conditions.append(terms.at_least(-falling if end is None else slope.scaled(end) - share))
            if low is None and high is None:
                conditions.append(terms.equal(share))
        conditions.append(terms.at_least(total))
    session = Session(terms, solver=solver)
    session.add_all(conditions, deadline)
    match session.check("a schedule linear in the parameters", deadline):
        case Verdict.UNKNOWN:
            raise OutOfTimeError(session.failure)
        case Verdict.UNSATISFIABLE:
            raise UnsupportedError(
                "no schedule that is linear in the parameters suits the whole box; expected one for a certificate, "
                "try a smaller box"
            )
        case Verdict.SATISFIABLE:
            pass
    symbols = [terms.real(each) for row in unknowns.values() for term in row for each in term.variables]
    values = session.values(symbols)

    def value(term: Linear) -> Fraction:
        return Fraction(values.get(str(next(iter(term.variables))), 0))

    return {
        point: sum(
            (variable(ParameterReference(name)).scaled(value(term)) for name, term in zip(names, row[1:], strict=True)),
            constant(value(row[0])),
        )
        for point, row in unknowns.items()
    }


Progress = Callable[[int, int, str], None]
FindMultiples = Callable[[Form], list[tuple[int, Fraction]]]


def digests(files: Mapping[str, Path]) -> dict[str, str]:
    """SHA-256 of files, by what they are."""
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items()}


class PlanCertificate:
    """A certificate about a plan, built obligation by obligation.

    Args:
        encoding: the plan's formulas.
        kind: `plan` for the nominal point, `box`, `maximal` or `region`.
        box: the parameter values that it is about, unless it is about a region.
        inputs: digests of the input files.
        solver: `z3` or `cvc5`, for what is searched; nothing that it says is trusted.
        deadline: when to give up, with OutOfTimeError.
        on_obligation: called with the number examined so far, of how many, and the obligation's name.
    """

    def __init__(
        self,
        encoding: Encoding,
        *,
        kind: str,
        inputs: Mapping[str, str],
        box: Box | None = None,
        solver: str = "z3",
        deadline: Deadline = NEVER,
        on_obligation: Progress | None = None,
    ) -> None:
        self._encoding = encoding
        self._box = box
        self._solver = solver
        self._deadline = deadline
        self._on_obligation = on_obligation
        self._ground = GroundPlan(encoding.plan)
        self._circuit = Circuit()
        self._translator = Translator(encoding.terms, self._circuit)
        self._refuter = Refuter(self._circuit)
        self.writer = CertificateWriter(self._circuit, _header(encoding, box, kind, inputs))
        self.writer.add(*self._ground.lines())
        self._paths = LongestPaths(
            self._ground, dict.fromkeys((p.name for p in encoding.plan.parameters), (None, None))
        )
        self._network_roles = network_roles(self._ground, self._circuit)

    def add_box(self) -> None:
        """A schedule for the box, and every obligation in it.

        Raises:
            RefutedError: if an obligation breaks somewhere in the box.
            UnsupportedError: if the existence of schedules cannot be certified; some points may have none.
            OutOfTimeError: if the deadline passes.
        """
        box = self._require_box()
        times = schedule_over(self._ground, box.ranges, solver=self._solver, deadline=self._deadline)
        known: dict[int, Line] = {}
        for place, (name, interval) in enumerate(box.intervals.items()):
            value = variable(ParameterReference(name))
            ends = ((1, interval.lower, interval.lower_closed), (-1, interval.upper, interval.upper_closed))
            for index, (sign, end, closed) in enumerate(ends):
                if end is not None:
                    known[self._literal_of((value - end).scaled(sign), strict=not closed)] = ["w", 2 * place + index]
        self._add_schedule([form_of(time) for time in times], lambda form: _multiples_in(box, form))
        self._paths = LongestPaths(self._ground, box.ranges)
        self._add_obligations(known, str(box))

    def add_region(self, region: Region) -> None:
        """A schedule and every obligation in each piece of a region, and why everything outside of it is bad.

        Raises:
            RefutedError: if an obligation breaks somewhere in it.
            UnsupportedError: if it is not the whole envelope, or schedules cannot be certified.
            OutOfTimeError: if the deadline passes.
        """
        known: list[Polyhedron] = []
        for whole in region.as_union().pieces:
            for piece, values in scheduled(self._ground, whole, solver=self._solver, deadline=self._deadline):
                known.append(piece)
                where = self._begin("piece", piece)
                self._add_schedule(self._times(values), partial(multiples, halves_of(piece)))
                self._paths = LongestPaths(self._ground, ranges_of(piece))
                self._add_obligations(where, f"the piece {piece}")
        self._add_outside(known, region.complement().as_union().pieces)

    def _add_outside(self, known: list[Polyhedron], bad: Sequence[Polyhedron]) -> None:
        """Bad polyhedra, until they and the pieces are all parameter values within the declared bounds."""
        parameters = self._encoding.plan.parameters
        bounds = {p.name: Interval(p.lower, p.upper, p.lower is not None, p.upper is not None) for p in parameters}
        everything = Polyhedron.of_box(bounds, Box(bounds))
        exactness = Exactness(
            self._encoding,
            self._ground,
            self._circuit,
            self._network_roles,
            solver=self._solver,
            deadline=self._deadline,
        )
        false = self._encoding.terms.false
        conjuncts = {each.name: self._breaking(each) for each in self._encoding.obligations if each.violation != false}
        for point in uncovered(everything, known, bad):
            self._deadline.enforce()
            reason = exactness.explain(point, conjuncts)
            known.append(reason.polyhedron)
            match reason:
                case Nowhere():
                    self._add_nowhere(reason)
                case Broken():
                    self._add_broken(reason)
        self.writer.add(["rest"])
        roles: dict[int, Line] = {}
        for place, (name, interval) in enumerate(bounds.items()):
            for index, (sign, end) in enumerate(((1, interval.lower), (-1, interval.upper))):
                if end is not None:
                    least = (variable(ParameterReference(name)) - end).scaled(sign)
                    roles[self._literal_of(least)] = ["w", 2 * place + index]
        for index, polyhedron in enumerate(known):
            sides = tuple(literal_of(self._circuit, half) for half in halves_of(polyhedron))
            roles[-self._circuit.add(Conjunction(sides))] = ["o", index]
        self._refuted("the rest", roles)

    def _add_nowhere(self, reason: Nowhere) -> None:
        roles = self._begin("outside", reason.polyhedron)
        for step in reason.steps:
            place = self._ground.places
            if isinstance(step, list):
                gap, role = place[step[0]], ["z", *step]
            else:
                source, target, length = self._ground.edges[step]
                gap, role = place[target] - place[source] - length, ["n", step]
            if gap.variables:
                roles.setdefault(self._literal_of(gap), role)
        self._refuted("a schedule", roles)

    def _add_broken(self, reason: Broken) -> None:
        polyhedron, values = reason.polyhedron, reason.values
        roles = self._begin("outside", polyhedron)
        free = free_points(self._ground)
        others = [name for name in values if name not in free]
        lines = [[name, _line(values[name])] for name in others]
        self._add_schedule(self._times(values), partial(multiples, halves_of(polyhedron)), lines)
        index = len(halves_of(polyhedron))
        for name in (*free, *others):
            for sign in (1, -1):
                form = combined({name: Fraction(sign)}, values[name], -sign)
                roles[literal_of(self._circuit, (form, False))] = ["w", index]
                index += 1
        own = self._separation(reason.obligation.name)
        kept = -self._circuit.add(Conjunction(reason.conjuncts))
        roles[kept] = ["x", [own.get(each, ["t"]) for each in reason.conjuncts]]
        self._refuted(reason.obligation.name, roles)

    def _breaking(self, obligation: Obligation) -> list[int]:
        """Literals that are true together where an obligation breaks, without those of the network."""
        if obligation.stage is Stage.SEPARATION:
            return list(self._separation(obligation.name))
        literals = map(self._translator.literal, self._encoding.query(obligation))
        return [each for each in conjuncts(self._circuit, literals) if each not in self._network_roles]

    def _begin(self, part: str, polyhedron: Polyhedron) -> dict[int, Line]:
        """State a polyhedron that follows; the roles of its sides."""
        halves = halves_of(polyhedron)
        self.writer.add([part, [[_line(form), strict] for form, strict in halves]])
        return {literal_of(self._circuit, half): ["w", index] for index, half in enumerate(halves)}

    def _times(self, values: Mapping[str, Form]) -> list[Form]:
        return [substituted(form_of(self._ground.places[index]), values) for index in sorted(self._ground.places)]

    def _add_schedule(self, times: list[Form], find: FindMultiples, others: Sequence[Line] = ()) -> None:
        """A schedule, with multiples of what is known of the parameters for each constraint of the network."""
        proofs: dict[tuple[tuple[str, Fraction], ...], Line] = {}
        found: list[Line] = []
        zero = ((0, point, constant(0)) for point in sorted(self._ground.places))
        for source, target, length in (*zero, *self._ground.edges):
            gap = combined(combined(times[target], times[source], -1), form_of(length), -1)
            key = tuple(gap.items())
            if key not in proofs:
                proofs[key] = [[index, number(factor)] for index, factor in find(gap)]
            found.append(proofs[key])
        self.writer.add(["schedule", [_line(time) for time in times], found, *([list(others)] if others else [])])

    def _refuted(self, name: str, roles: Mapping[int, Line]) -> None:
        """A refutation of literals, all of which the checker can compare."""
        roots = list(roles)
        self.writer.refuted(name, roots, self._refuter.refute(roots, self._deadline), roles.__getitem__)

    def _add_obligations(self, known: dict[int, Line], where: str) -> None:
        obligations = self._encoding.obligations
        for index, obligation in enumerate(obligations):
            if self._on_obligation is not None:
                self._on_obligation(index, len(obligations), obligation.name)
            self._refute(obligation, known, where)

    def _require_box(self) -> Box:
        if self._box is None:
            raise ValueError("a certificate about a region has no box")
        return self._box

    def add_witnesses(self) -> None:
        """Why no valid box contains this one.

        Raises:
            UnsupportedError: if a face has no witness: the box is not maximal, or it cannot be written down.
            OutOfTimeError: if the deadline passes.
        """
        found = Witnesses(
            self._encoding, self._ground, self._require_box(), deadline=self._deadline, solver=self._solver
        )
        self.writer.add(*found.lines())

    def _refute(self, obligation: Obligation, known: dict[int, Line], where: str) -> None:
        if obligation.violation is self._encoding.terms.false:
            self._add_folded(obligation, known)
            return
        roots = [*known, *conjuncts(self._circuit, map(self._translator.literal, self._encoding.query(obligation)))]
        try:
            refutation = self._refuter.refute(roots, self._deadline)
        except NotRefutedError:
            message = f"{obligation.name!r} breaks for some values of {where}; expected values for which it holds"
            raise RefutedError(message) from None
        own = self._separation(obligation.name) if obligation.stage is Stage.SEPARATION else {}

        def role(literal: int) -> Line:
            return known.get(literal) or own.get(literal) or self._network_roles.get(literal) or ["t"]

        self.writer.refuted(obligation.name, roots, refutation, role)

    # -- what the checker can compare ----------------------------------------------------------------------------------

    def _literal_of(self, least: Linear, *, strict: bool = False) -> int:
        """`least ≥ 0`, or `> 0`."""
        return literal_of(self._circuit, (form_of(least), strict))

    def _add_folded(self, obligation: Obligation, known: dict[int, Line]) -> None:
        """An obligation whose formula is constant: separations are proved by a path of the network, if there is one."""
        places, epsilon = self._ground.places, self._encoding.epsilon
        own = self._separation(obligation.name) if obligation.stage is Stage.SEPARATION else {}
        for _, second, first in own.values():
            gap = places[second] - places[first]
            if not gap.variables and gap.constant_term >= epsilon:
                self.writer.add(["apart", first, second])
                return
            steps = self._paths.between(first, second, epsilon) if gap.variables else None
            if steps is not None:
                edges = ((step, *self._ground.edges[step]) for step in steps)
                gaps = {step: places[target] - places[source] - length for step, source, target, length in edges}
                network = {self._literal_of(gap): ["n", step] for step, gap in gaps.items() if gap.variables}
                self._refuted(obligation.name, {**known, **network, **own})
                return
        self.writer.add(["folded", obligation.name])

    def _separation(self, name: str) -> dict[int, Line]:
        """`|t_a − t_b| < ε` for the two time points that the obligation's name mentions."""
        points = {str(point): index for point, index in self._ground.numbers.items()}
        first, _, second = name.removeprefix("separation: ").partition(", ")
        if first not in points or second not in points:
            return {}
        a, b = points[first], points[second]
        gap, epsilon = self._ground.places[a] - self._ground.places[b], self._encoding.epsilon
        return {
            self._literal_of(gap + epsilon, strict=True): ["s", a, b],
            self._literal_of(-gap + epsilon, strict=True): ["s", b, a],
        }


def _line(form: Form) -> Line:
    """A linear form as JSON."""
    return [[number(factor), *([name] if name else [])] for name, factor in form.items()]


def _multiples_in(box: Box, form: Form) -> list[tuple[int, Fraction]]:
    """Multiples of the ends of a box, as the checker numbers them, that leave something not negative of a form."""
    names = list(box.intervals)
    return [(2 * names.index(name) + (factor < 0), abs(factor)) for name, factor in form.items() if name]


class FormulaCertificate:
    """A certificate that formulas have no common model, such as those that say what a correct execution is.

    Args:
        terms: the environment of the formulas.
        name: what the formulas are about.
        inputs: digests of the input files.
    """

    def __init__(self, terms: Terms, *, name: str, inputs: Mapping[str, str]) -> None:
        self._name = name
        self._circuit = Circuit()
        self._translator = Translator(terms, self._circuit)
        self.writer = CertificateWriter(self._circuit, {"kind": "knowledge", "inputs": dict(inputs)})

    def add(self, formulas: Iterable[Formula], deadline: Deadline) -> None:
        """Refute the formulas together.

        Raises:
            NotRefutedError: if they have a model.
            OutOfTimeError: if the deadline passes.
        """
        roots = [self._translator.literal(formula) for formula in formulas]
        refutation = Refuter(self._circuit).refute(roots, deadline)
        self.writer.refuted(self._name, roots, refutation, lambda _: ["t"])


def _header(encoding: Encoding, box: Box | None, kind: str, inputs: Mapping[str, str]) -> dict[str, Any]:
    header = {
        "kind": kind,
        "inputs": dict(inputs),
        "encoding": encoding.name,
        "epsilon": number(encoding.epsilon),
        "parameters": [[p.name, optional(p.lower), optional(p.upper)] for p in encoding.plan.parameters],
    }
    if box is not None:
        header["box"] = [
            [optional(each.lower), each.lower_closed, optional(each.upper), each.upper_closed]
            for each in (box[parameter.name] for parameter in encoding.plan.parameters)
        ]
    return header
