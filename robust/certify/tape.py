"""Certificates, made with the checker's own formulas: a tape of the hints that it asks for, in its order."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import islice, product
from pathlib import Path

from robust.certify.checker.formulas import FALSE, Formulas
from robust.certify.checker.reader import Ground, Linear
from robust.certify.hints import Fact, KnownFacts, Line, implied, refutation
from robust.certify.orders import OrderLemmas, affine_times, constant_times, placed, positive_circle
from robust.certify.refute import NotRefutedError
from robust.encode.variables import Range
from robust.errors import RefutedError, UnsupportedError
from robust.files import atomic_write
from robust.qe.box import Box
from robust.smt.limits import Deadline

FORMAT = "robust/certificate/2"
CORNERS = 1024
Progress = Callable[[int, int, str], None]


def texts(form: Mapping[str, Fraction]) -> Line:
    """A linear form: pairs of name and coefficient."""
    return [[name, str(factor)] for name, factor in sorted(form.items())]


def sums(multiples: Iterable[tuple[int, Fraction | int]]) -> Line:
    """Multiples of facts: pairs of number and factor."""
    return [[number, int(factor) if factor == int(factor) else str(factor)] for number, factor in multiples]


def header(kind: str, box: Box | None = None) -> Line:
    """The first line of a certificate."""
    if box is None:
        return [FORMAT, kind, None]
    ends = []
    for each in box.intervals.values():
        low, high = (None if end is None else str(end) for end in (each.lower, each.upper))
        ends.append([low, each.lower_closed and low is not None, high, each.upper_closed and high is not None])
    return [FORMAT, kind, ends]


def box_facts(box: Box) -> list[Fact]:
    """The ends of a box, in the checker's order."""
    found: list[Fact] = []
    for name, each in box.intervals.items():
        for end, closed, sign in ((each.lower, each.lower_closed, 1), (each.upper, each.upper_closed, -1)):
            if end is not None:
                form = {name: Fraction(sign), "": -sign * end}
                found.append(({key: value for key, value in form.items() if value}, not closed))
    return found


def write(lines: Sequence[Line], path: Path) -> int:
    """Write a certificate; its size in bytes."""
    data = packed(lines)
    atomic_write(path, data, None)
    return len(data)


def packed(lines: Sequence[Line]) -> bytes:
    """The content of a certificate's file."""
    return gzip.compress("".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines).encode(), mtime=0)


def good_lines(
    ground: Ground,
    epsilon: Fraction,
    box: Box,
    *,
    solver: str,
    deadline: Deadline,
    on_obligation: Progress | None = None,
) -> list[Line]:
    """That all values in a box have a schedule, and none that breaks an obligation.

    Raises:
        RefutedError: if an obligation breaks somewhere in the box.
        UnsupportedError: if no schedule that is linear in the parameters suits the whole box.
        OutOfTimeError: if the deadline passes.
    """
    formulas, region = Formulas(ground, epsilon), box_facts(box)
    times = constant_times(formulas, box.ranges) or affine_times(formulas, region, solver=solver, deadline=deadline)
    if times is None:
        _require_schedules(ground, box)
        raise UnsupportedError("no schedule that is linear in the parameters suits all of these values; try fewer")
    orders, *refutations = obligation_lines(
        formulas, region, box.ranges, (), deadline=deadline, on_obligation=on_obligation
    )
    return [orders, *schedule_lines(formulas, region, times), *refutations]


def _require_schedules(ground: Ground, box: Box) -> None:
    """RefutedError if a corner of the box leaves no schedule: the values that leave some are convex."""
    ends = [
        [end for end in (each.lower, each.upper) if end is not None] or [Fraction(0)] for each in box.intervals.values()
    ]
    for corner in islice(product(*map(dict.fromkeys, ends)), CORNERS):
        values = dict(zip(box.intervals, corner, strict=True))
        if positive_circle(ground, values) is not None:
            shown = ", ".join(f"{name} = {value}" for name, value in values.items())
            raise RefutedError(f"the network allows no schedule for {shown}; expected values for which it does")


def schedule_lines(formulas: Formulas, region: Sequence[Fact], times: Mapping[str, Linear]) -> list[Line]:
    """That a schedule keeps the network all over a region."""
    finder = Multiples(region)
    kept = [sums(finder.of(slack)) for slack in placed(formulas, times)]
    return [["schedule", *(texts(times[point]) for point in formulas.free())], ["kept", *kept]]


def obligation_lines(
    formulas: Formulas,
    region: Sequence[Fact],
    ranges: Mapping[str, Range],
    also: Sequence[int],
    *,
    deadline: Deadline,
    on_obligation: Progress | None = None,
) -> list[Line]:
    """Order lemmas of a region, then for each obligation that no schedule breaks it where other literals hold, too.

    Raises:
        RefutedError: if one does.
        OutOfTimeError: if the deadline passes.
    """
    ground = formulas.ground
    known = KnownFacts([*region, *((formulas.slack(edge), False) for edge in ground.edges)])
    formulas.known = orders = OrderLemmas(ground, ranges)  # type: ignore[assignment]
    obligations = formulas.obligations()
    refutations: list[Line] = []
    for number, (label, broken) in enumerate(obligations):
        deadline.enforce()
        literal = broken()
        if literal != FALSE:
            try:
                refutations.append(refutation(formulas, known, literal, deadline, also))
            except NotRefutedError:
                message = f"{label!r} breaks for some of these values; expected values for which it holds"
                raise RefutedError(message) from None
        if on_obligation is not None:
            on_obligation(number + 1, len(obligations), label)
    formulas.evaluate()
    finder = Multiples(region)
    lemmas = [[a, b, path, str(bound), sums(finder.of(rest))] for a, b, path, bound, rest in orders.lemmas()]
    return [["orders", *lemmas], *refutations]


class Multiples:
    """Multiples of the sides of a region that leave something not negative of a form: of a box, its ends."""

    def __init__(self, region: Sequence[Fact]) -> None:
        self._facts = KnownFacts(region)
        self._ends: dict[tuple[str, bool], int] = {}
        for number, (form, _) in enumerate(region):
            names = [each for each in form if each]
            if len(names) == 1 and abs(form[names[0]]) == 1:
                self._ends[names[0], form[names[0]] > 0] = number
        self._is_box = len(self._ends) == len(region)

    def of(self, form: Linear) -> list[tuple[int, Fraction]]:
        if self._is_box:
            return [(self._ends[name, factor > 0], abs(factor)) for name, factor in form.items() if name]
        return implied(self._facts, form)
