"""From a plan and a box to a certificate that every obligation holds all over the box."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from robust.certify.circuit import Circuit, Conjunction, Translator
from robust.certify.document import CertificateWriter, Role
from robust.certify.existence import schedule_over
from robust.certify.ground import GroundPlan, Line, expression, number, optional
from robust.certify.refute import NotRefutedError, Refuter
from robust.certify.witness import Witnesses
from robust.encode.interface import Encoding, Obligation, Stage
from robust.encode.variables import Linear, variable
from robust.errors import InputError
from robust.irr.box import Box
from robust.irr.containment import within
from robust.plan.model import ParameterReference, TimePoint
from robust.smt.limits import Deadline
from robust.smt.terms import Formula

Progress = Callable[[int, int, str], None]


def digests(files: Mapping[str, Path]) -> dict[str, str]:
    """SHA-256 of files, by what they are."""
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items()}


class BoxCertificate:
    """A certificate that a plan is valid over a box, built obligation by obligation.

    Args:
        encoding: the plan's formulas.
        box: the parameter values that it is about.
        kind: `plan` for the nominal point, `box`, or `maximal`.
        inputs: digests of the input files.
        deadline: when to give up, with OutOfTimeError.
        on_obligation: called with the number examined so far, of how many, and the obligation's name.
    """

    def __init__(
        self,
        encoding: Encoding,
        box: Box,
        *,
        kind: str,
        inputs: Mapping[str, str],
        deadline: Deadline = Deadline(),  # noqa: B008 - immutable
        on_obligation: Progress | None = None,
    ) -> None:
        self.encoding = encoding
        self.box = box
        self.deadline = deadline
        self._on_obligation = on_obligation
        self.ground = GroundPlan(encoding.plan)
        self._circuit = Circuit()
        self._translator = Translator(encoding.terms, self._circuit)
        self._refuter = Refuter(self._circuit)
        self.writer = CertificateWriter(self._circuit, _header(encoding, box, kind, inputs))
        self._roles = self._known_roles()

    def build(self) -> None:
        """Everything but witnesses.

        Raises:
            InputError: if an obligation breaks somewhere in the box, or some of its points have no schedule.
            UnsupportedError: if the existence of schedules cannot be certified.
            OutOfTimeError: if the deadline passes.
        """
        self.writer.add(*self.ground.lines())
        times = schedule_over(self.ground, self.box.ranges, deadline=self.deadline)
        self.writer.add(["schedule", [expression(time) for time in times]])
        obligations = self.encoding.obligations
        for index, obligation in enumerate(obligations):
            if self._on_obligation is not None:
                self._on_obligation(index, len(obligations), obligation.name)
            self._refute(obligation)

    def add_witnesses(self) -> None:
        """Why no valid box contains this one.

        Raises:
            UnsupportedError: if a face has no witness: the box is not maximal, or it cannot be written down.
            OutOfTimeError: if the deadline passes.
        """
        self.writer.add(*Witnesses(self.encoding, self.ground, self.box, deadline=self.deadline).lines())

    def _refute(self, obligation: Obligation) -> None:
        if obligation.violation is self.encoding.terms.false:
            self.writer.add(["folded", obligation.name])
            return
        formulas = [*self.encoding.query(obligation), *within(self.encoding, self.box.intervals)]
        roots = self._conjuncts(formulas)
        try:
            refutation = self._refuter.refute(roots, self.deadline)
        except NotRefutedError:
            raise InputError(f"{obligation.name!r} breaks in {self.box}; expected a box that is valid") from None
        self.writer.refuted(obligation.name, roots, refutation, self._role(obligation))

    def _conjuncts(self, formulas: Iterable[Formula]) -> list[int]:
        """The literals of formulas, conjunctions split."""
        pending = [self._translator.literal(formula) for formula in formulas][::-1]
        roots: dict[int, None] = {}
        while pending:
            literal = pending.pop()
            node = self._circuit.node(literal)
            if isinstance(node, Conjunction) and literal > 0:
                pending += reversed(node.inputs)
            else:
                roots[literal] = None
        return list(roots)

    # -- what the checker can compare ----------------------------------------------------------------------------------

    def _literal_of(self, least: Linear, *, strict: bool = False) -> int:
        """`least ≥ 0`, or `> 0`."""
        factors = {str(unknown): -factor for unknown, factor in least.coefficients()}
        return self._circuit.at_most(factors, least.constant_term, strict=strict)

    def _known_roles(self) -> dict[int, Line]:
        roles: dict[int, Line] = {}
        for place, parameter in enumerate(self.encoding.plan.parameters):
            interval, value = self.box[parameter.name], variable(ParameterReference(parameter.name))
            ends = ((1, interval.lower, interval.lower_closed), (-1, interval.upper, interval.upper_closed))
            for index, (sign, end, closed) in enumerate(ends):
                if end is not None:
                    literal = self._literal_of((value - end).scaled(sign), strict=not closed)
                    roles.setdefault(literal, ["w", 2 * place + index])
        for point, time in self.ground.places.items():
            roles.setdefault(self._literal_of(time), ["z", point])
        for index, bound in enumerate(self.ground.bounds):
            for side, source, target, length in bound.sides():
                gap = self.ground.places[target] - self.ground.places[source] - length
                roles.setdefault(self._literal_of(gap), ["n", index, side])
        return roles

    def _role(self, obligation: Obligation) -> Role:
        own: dict[int, Line] = {}
        if obligation.stage is Stage.SEPARATION:
            own = self._separation(obligation.name)
        return lambda literal: own.get(literal) or self._roles.get(literal) or ["t"]

    def _separation(self, name: str) -> dict[int, Line]:
        """`|t_a − t_b| < ε` for the two time points that the obligation's name mentions."""
        points = {str(point): index for point, index in self.ground.numbers.items()}
        first, _, second = name.removeprefix("separation: ").partition(", ")
        if first not in points or second not in points:
            return {}
        a, b = points[first], points[second]
        gap, epsilon = self.ground.places[a] - self.ground.places[b], self.encoding.epsilon
        return {
            self._literal_of(gap + epsilon, strict=True): ["s", a, b],
            self._literal_of(-gap + epsilon, strict=True): ["s", b, a],
        }


def _header(encoding: Encoding, box: Box, kind: str, inputs: Mapping[str, str]) -> dict[str, Any]:
    return {
        "kind": kind,
        "inputs": dict(inputs),
        "encoding": encoding.name,
        "epsilon": number(encoding.epsilon),
        "parameters": [[p.name, optional(p.lower), optional(p.upper)] for p in encoding.plan.parameters],
        "box": [
            [optional(each.lower), each.lower_closed, optional(each.upper), each.upper_closed]
            for each in (box[parameter.name] for parameter in encoding.plan.parameters)
        ],
    }
