"""Certificates, made with the checker's own formulas: a tape of the hints that it asks for, in its order."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

from robust.certify.checker.formulas import FALSE, Formulas
from robust.certify.checker.reader import Ground, Linear
from robust.certify.hints import Fact, KnownFacts, Line, implied, refutation
from robust.certify.network import Orders, affine_times, constant_times, placed
from robust.certify.refute import NotRefutedError
from robust.encode.variables import Range
from robust.errors import RefutedError, UnsupportedError
from robust.files import atomic_write
from robust.qe.box import Box
from robust.smt.limits import Deadline

FORMAT = "robust/certificate/2"
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
    ends = ((each.lower, each.lower_closed, each.upper, each.upper_closed) for each in box.intervals.values())
    return [
        FORMAT,
        kind,
        [
            [None if low is None else str(low), low_closed and low is not None]
            + [None if high is None else str(high), high_closed and high is not None]
            for low, low_closed, high, high_closed in ends
        ],
    ]


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
    text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines)
    data = gzip.compress(text.encode(), mtime=0)
    atomic_write(path, data, None)
    return len(data)


def good_lines(
    ground: Ground,
    epsilon: Fraction,
    region: Sequence[Fact],
    ranges: Mapping[str, Range],
    *,
    solver: str,
    deadline: Deadline,
    on_obligation: Progress | None = None,
) -> list[Line]:
    """That all values of a region have a schedule, and none that breaks an obligation.

    Raises:
        RefutedError: if an obligation breaks somewhere in the region.
        UnsupportedError: if no schedule that is linear in the parameters suits the whole region.
        OutOfTimeError: if the deadline passes.
    """
    formulas = Formulas(ground, epsilon)
    known = KnownFacts([*region, *((formulas.slack(edge), False) for edge in ground.edges)])
    of_parameters = KnownFacts(region)
    times = constant_times(formulas, ranges) or affine_times(formulas, region, solver=solver, deadline=deadline)
    if times is None:
        raise UnsupportedError("no schedule that is linear in the parameters suits all of these values; try fewer")
    orders = Orders(ground, ranges)
    formulas.known = orders  # type: ignore[assignment]
    obligations = formulas.obligations()
    refutations: list[Line] = []
    for number, (label, broken) in enumerate(obligations):
        deadline.enforce()
        literal = broken()
        if literal != FALSE:
            try:
                refutations.append(refutation(formulas, known, literal, deadline))
            except NotRefutedError:
                message = f"{label!r} breaks for some of these values; expected values for which it holds"
                raise RefutedError(message) from None
        if on_obligation is not None:
            on_obligation(number + 1, len(obligations), label)
    finder = _Multiples(region, of_parameters)
    lemmas = [[a, b, path, str(bound), sums(finder.of(rest))] for a, b, path, bound, rest in orders.lemmas()]
    kept = [sums(finder.of(slack)) for slack in placed(formulas, times)]
    return [
        ["orders", *lemmas],
        ["schedule", *(texts(times[point]) for point in formulas.free())],
        ["kept", *kept],
        *refutations,
    ]


class _Multiples:
    """Multiples of the sides of a region that leave something not negative of a form: of a box, its ends."""

    def __init__(self, region: Sequence[Fact], facts: KnownFacts) -> None:
        self._facts = facts
        self._ends: dict[tuple[str, bool], int] = {}
        self._is_box = True
        for number, (form, _) in enumerate(region):
            (name, *others) = [each for each in form if each]
            self._is_box = self._is_box and not others and abs(form[name]) == 1
            self._ends.setdefault((name, form[name] > 0), number)

    def of(self, form: Linear) -> list[tuple[int, Fraction]]:
        names = {name: factor for name, factor in form.items() if name}
        if self._is_box and len(self._ends) == len(self._facts.sides):
            return [(self._ends[name, factor > 0], abs(factor)) for name, factor in names.items()]
        return implied(self._facts, form)
