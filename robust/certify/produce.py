"""From a plan and parameter values to a certificate that every obligation holds for all of them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from robust.certify.circuit import Circuit, Translator, conjuncts
from robust.certify.document import CertificateWriter
from robust.certify.existence import schedule_over
from robust.certify.ground import GroundPlan, Line, expression, number, optional
from robust.certify.refute import NotRefutedError, Refuter
from robust.certify.witness import Witnesses
from robust.encode.interface import Encoding, Obligation, Stage
from robust.encode.variables import Linear, variable
from robust.errors import InputError
from robust.irr.box import Box
from robust.plan.model import ParameterReference
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline
from robust.smt.terms import Formula, Terms

Progress = Callable[[int, int, str], None]


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
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
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
        self._network_roles = self._roles_of_network()

    def add_box(self) -> None:
        """A schedule for the box, and every obligation in it.

        Raises:
            InputError: if an obligation breaks somewhere in the box, or some of its points have no schedule.
            UnsupportedError: if the existence of schedules cannot be certified.
            OutOfTimeError: if the deadline passes.
        """
        box = self._require_box()
        times = schedule_over(self._ground, box.ranges, solver=self._solver, deadline=self._deadline)
        self.writer.add(["schedule", [expression(time) for time in times]])
        known: dict[int, Line] = {}
        for place, (name, interval) in enumerate(box.intervals.items()):
            value = variable(ParameterReference(name))
            ends = ((1, interval.lower, interval.lower_closed), (-1, interval.upper, interval.upper_closed))
            for index, (sign, end, closed) in enumerate(ends):
                if end is not None:
                    known[self._literal_of((value - end).scaled(sign), strict=not closed)] = ["w", 2 * place + index]
        self._add_obligations(known, str(box))

    def add_region(self, pieces: Sequence[Polyhedron]) -> None:
        """Every obligation in each of some polyhedra.

        Raises:
            InputError: if an obligation breaks somewhere in one of them.
            OutOfTimeError: if the deadline passes.
        """
        for piece in pieces:
            halves = [half for constraint in piece.constraints for half in constraint.halves()]
            known: dict[int, Line] = {}
            statements: Line = []
            for half in halves:
                terms: Line = [[number(-factor), name] for name, factor in half.coefficients]
                constant: Line = [[number(half.constant)]] if half.constant else []
                literal = self._circuit.at_most(dict(half.coefficients), half.constant, strict=half.is_strict)
                known[literal] = ["w", len(statements)]
                statements.append([[*terms, *constant], half.is_strict])
            self.writer.add(["piece", statements])
            self._add_obligations(known, f"the piece {piece}")

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
            self.writer.add(["folded", obligation.name])
            return
        roots = [*known, *conjuncts(self._circuit, map(self._translator.literal, self._encoding.query(obligation)))]
        try:
            refutation = self._refuter.refute(roots, self._deadline)
        except NotRefutedError:
            message = f"{obligation.name!r} breaks for some values of {where}; expected values for which it holds"
            raise InputError(message) from None
        own = self._separation(obligation.name) if obligation.stage is Stage.SEPARATION else {}

        def role(literal: int) -> Line:
            return known.get(literal) or own.get(literal) or self._network_roles.get(literal) or ["t"]

        self.writer.refuted(obligation.name, roots, refutation, role)

    # -- what the checker can compare ----------------------------------------------------------------------------------

    def _literal_of(self, least: Linear, *, strict: bool = False) -> int:
        """`least ≥ 0`, or `> 0`."""
        factors = {str(unknown): -factor for unknown, factor in least.coefficients()}
        return self._circuit.at_most(factors, least.constant_term, strict=strict)

    def _roles_of_network(self) -> dict[int, Line]:
        roles: dict[int, Line] = {}
        for point, time in self._ground.places.items():
            roles.setdefault(self._literal_of(time), ["z", point])
        for index, bound in enumerate(self._ground.bounds):
            for side, source, target, length in bound.sides():
                gap = self._ground.places[target] - self._ground.places[source] - length
                roles.setdefault(self._literal_of(gap), ["n", index, side])
        return roles

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
