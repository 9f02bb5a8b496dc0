"""Certificates, made with the checker's own formulas: a tape of the hints that it asks for, in its order.

The first hints are orders of time points that a network implies for all parameter values of a region, and schedules
that are functions of the parameters.
"""

import gzip
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import groupby, islice, product
from operator import itemgetter
from pathlib import Path
from typing import Any

from robust import errors, records
from robust.certify.checker.formulas import FALSE, Formulas, plus, replaced
from robust.certify.checker.reader import Ground, Linear, constant
from robust.certify.hints import Fact, KnownFacts, Line, NotRefutedError, implied, refutation
from robust.encode.interface import Auxiliary, Range, variable
from robust.encode.interface import constant as term_of
from robust.network.differences import Distances
from robust.qe.box import Box
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Formula, Satisfiability, Session, Terms

Point = Mapping[str, Fraction]


def least(form: Mapping[str, Fraction], ranges: Mapping[str, Range]) -> Fraction | None:
    """The least value of a form over ranges of its names; None if there is none."""
    total = Fraction(0)
    for name, factor in form.items():
        end = Fraction(1) if not name else ranges[name][factor < 0]
        if end is None:
            return None
        total += factor * end
    return total


class OrderLemmas:
    """Greatest lower bounds of distances between time points, each constraint at its least over the parameters' ranges.

    It stands for the checker's table of known orders, and remembers which of them decided something. Where constraints
    contradict each other it knows none.
    """

    def __init__(self, ground: Ground, ranges: Mapping[str, Range]) -> None:
        self._ground = ground
        floors = [(number, a, b, least(w, ranges)) for number, (a, b, w) in enumerate(ground.edges) if a != b]
        self._edges = [number for number, *_, floor in floors if floor is not None]
        bounds = ((a, b, floor) for _, a, b, floor in floors if floor is not None)
        self._distances = Distances(range(len(ground.points)), bounds)
        self._times = self._distances.network.schedule or ()
        self._used: dict[tuple[int, int], Fraction] = {}

    def get(self, pair: tuple[int, int], default: Any = None) -> Any:
        """At least this much after the first point is the second; as a dictionary's."""
        a, b = pair
        if not self._times or self._times[b] < self._times[a]:
            return default  # the least schedule contradicts any distance that would matter
        distance = None if a == b else self._distances.least(a, b)
        if distance is None or distance < 0:
            return default
        self._used[pair] = distance
        return distance

    def lemmas(self) -> Iterator[tuple[int, int, list[int], Fraction, Linear]]:
        """For each order that was asked for: its points, its path of constraints and earlier lemmas, its length, and
        by how much the path may be longer."""
        edges, numbers = self._ground.edges, dict[tuple[int, int], int]()
        ordered = sorted(self._used, key=lambda pair: (pair[0], self._slack(*pair), self._times[pair[1]]))
        for source, pairs in groupby(ordered, key=itemgetter(0)):
            arrivals = self._distances.network.arrivals(source)
            for _, goal in sorted(pairs, key=lambda pair: self._depth(arrivals, pair[1], source)):
                path, total, place = list[int](), Linear(), goal
                while place != source:
                    if (source, place) in numbers:
                        path.append(len(edges) + numbers[source, place])
                        total = plus(total, constant(self._used[source, place]))
                        break
                    place, origin = arrivals[place]
                    path.append(self._edges[origin])
                    total = plus(total, edges[path[-1]][2])
                bound = self._used[source, goal]
                numbers[source, goal] = len(numbers)
                yield source, goal, path[::-1], bound, plus(total, constant(bound), -1)

    def _slack(self, source: int, target: int) -> Fraction:
        times, used = self._times, self._used[source, target]
        return times[target] - times[source] - used * self._distances.scale

    @staticmethod
    def _depth(arrivals: Sequence[tuple[int, int]], point: int, source: int) -> int:
        depth = 0
        while point != source:
            point, depth = arrivals[point][0], depth + 1
        return depth


def constant_times(formulas: Formulas, ranges: Mapping[str, Range]) -> dict[str, Linear] | None:
    """The earliest times of free time points that suit the worst value of each constraint; None if there are none."""
    split = {point: _split(tie) for point, tie in formulas.ties.items()}
    edges: list[tuple[str, str, Fraction]] = []
    for a, b, w in formulas.ground.edges:
        (source, before), (target, after) = split[a], split[b]
        slack = least(plus(plus(after, before, -1), w, -1), ranges)
        if slack is None:
            return None
        edges.append((source, target, -slack))
    distances = Distances(["", *formulas.free()], edges)
    if distances.network.schedule is None or distances.times[""]:
        return None
    return {point: constant(distances.times[point]) for point in formulas.free()}


def _split(tie: Linear) -> tuple[str, Linear]:
    """The free time point that a time is tied to, if any, and the rest."""
    root = next((name for name in tie if name.startswith("@")), "")
    return root, {name: factor for name, factor in tie.items() if name != root or not root}


def affine_times(
    formulas: Formulas, facts: Sequence[Fact], *, solver: str, deadline: Deadline
) -> dict[str, Linear] | None:
    """Free time points as linear functions of the parameters that keep the network all over a region.

    By Farkas' lemma each constraint's slack is a sum of multiples of the region's sides and of something that is not
    negative; that is linear in the multipliers and in the coefficients of the functions.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    terms, names = Terms(), list(formulas.ground.parameters)
    columns = ["", *names]
    keys = [(point, column) for point in formulas.free() for column in columns]
    sought = {key: variable(Auxiliary("coefficient", index)) for index, key in enumerate(keys)}
    conditions: list[Formula] = []
    count = 0
    slacks = (formulas.slack(edge) for edge in formulas.ground.edges)
    for form in dict.fromkeys(tuple(sorted(slack.items())) for slack in slacks):
        rest = {column: term_of(0) for column in columns}
        for name, factor in form:
            if name in rest:
                rest[name] += factor
            else:
                for column in columns:
                    rest[column] += sought[name, column].scaled(factor)
        for side, _ in facts:
            multiplier = variable(Auxiliary("multiplier", count))
            count += 1
            conditions.append(terms.at_least(multiplier))
            for name, factor in side.items():
                rest[name] -= multiplier.scaled(factor)
        conditions.append(terms.at_least(rest[""]))
        conditions += [terms.equal(rest[column]) for column in names]
    session = Session(terms, solver=solver)
    session.add_all(conditions, deadline)
    verdict = session.check("a schedule that is linear on a region", deadline)
    if verdict is Satisfiability.UNKNOWN:
        raise OutOfTimeError
    if verdict is Satisfiability.UNSATISFIABLE:
        return None
    values = session.values([terms.real(unknown) for term in sought.values() for unknown in term.variables])
    times: dict[str, Linear] = {point: {} for point in formulas.free()}
    for (point, column), term in sought.items():
        value = Fraction(values.get(str(next(iter(term.variables))), 0))
        if value:
            times[point][column] = value
    return times


def placed(formulas: Formulas, times: Mapping[str, Linear]) -> list[Linear]:
    """The slack of each constraint of the network at these times."""
    return [replaced(formulas.slack(edge), times) for edge in formulas.ground.edges]


def evaluated(form: Linear, point: Point) -> Fraction:
    return sum((factor * (point[name] if name else 1) for name, factor in form.items()), Fraction(0))


def positive_circle(ground: Ground, point: Point) -> list[int] | None:
    """Constraints in a circle that no times keep at one point of parameter space; None if there is a schedule."""
    lengths = ((a, b, evaluated(w, point)) for a, b, w in ground.edges)
    cycle = Distances(range(len(ground.points)), lengths).network.cycle
    return None if cycle is None else list(cycle.origins)


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
    return [FORMAT, kind, None if box is None else stated(box)]


def stated(box: Box) -> list[Any]:
    """The ends of a box, as a first line says them."""
    ends = []
    for interval in box.intervals.values():
        low, high = (None if end is None else str(end) for end in (interval.lower, interval.upper))
        ends.append([low, interval.lower_closed and low is not None, high, interval.upper_closed and high is not None])
    return ends


def box_facts(box: Box) -> list[Fact]:
    """The ends of a box, in the checker's order."""
    facts: list[Fact] = []
    for name, interval in box.intervals.items():
        lower, upper = (interval.lower, interval.lower_closed, 1), (interval.upper, interval.upper_closed, -1)
        for end, closed, sign in (lower, upper):
            if end is not None:
                form = {name: Fraction(sign), "": -sign * end}
                facts.append(({key: value for key, value in form.items() if value}, not closed))
    return facts


def write(lines: Sequence[Line], path: Path) -> int:
    """Write a certificate; its size in bytes."""
    data = packed(lines)
    records.atomic_write(path, data, None)
    return len(data)


def packed(lines: Sequence[Line]) -> bytes:
    """The content of a certificate's file."""
    return gzip.compress("".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines).encode(), mtime=0)


def good_lines(
    ground: Ground,
    epsilon: Fraction,
    box: Box,
    sides: Sequence[Fact] = (),
    *,
    given: Mapping[str, Linear] | None = None,
    solver: str,
    deadline: Deadline,
    on_obligation: Progress | None = None,
) -> list[Line]:
    """Lines that say all values in a box, and within other sides, have a schedule, and none that breaks an obligation.

    Parameters that are not in the box are `given`.

    Raises:
        RefutedError: if an obligation breaks somewhere there.
        UnsupportedError: if no schedule that is linear in the parameters suits all of it.
        OutOfTimeError: if the deadline passes.
    """
    formulas, region = Formulas(ground, epsilon, given), [*box_facts(box), *sides]
    times = constant_times(formulas, box.ranges) or affine_times(formulas, region, solver=solver, deadline=deadline)
    if times is None:
        if not sides:
            _require_schedules(ground, box)
        raise errors.UnsupportedError(
            "no schedule that is linear in the parameters suits all of these values; try fewer"
        )
    orders, *refutations = obligation_lines(
        formulas, region, box.ranges, (), deadline=deadline, on_obligation=on_obligation
    )
    return [orders, *schedule_lines(formulas, region, times), *refutations]


def _require_schedules(ground: Ground, box: Box) -> None:
    """RefutedError if a corner of the box leaves no schedule: the values that leave some are convex."""
    ends = [
        [end for end in (interval.lower, interval.upper) if end is not None] or [Fraction(0)]
        for interval in box.intervals.values()
    ]
    for corner in islice(product(*map(dict.fromkeys, ends)), CORNERS):
        values = dict(zip(box.intervals, corner, strict=True))
        if positive_circle(ground, values) is not None:
            shown = ", ".join(f"{name} = {value}" for name, value in values.items())
            raise errors.RefutedError(f"the network allows no schedule for {shown}; expected values for which it does")


def schedule_lines(formulas: Formulas, region: Sequence[Fact], times: Mapping[str, Linear]) -> list[Line]:
    """Lines that say a schedule keeps the network all over a region."""
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
                message = f"a schedule breaks {label!r}; `robust check` shows one"
                raise errors.RefutedError(message) from None
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
            names = [name for name in form if name]
            if len(names) == 1 and abs(form[names[0]]) == 1:
                self._ends[names[0], form[names[0]] > 0] = number
        self._is_box = len(self._ends) == len(region)

    def of(self, form: Linear) -> list[tuple[int, Fraction]]:
        if self._is_box:
            return [(self._ends[name, factor > 0], abs(factor)) for name, factor in form.items() if name]
        return implied(self._facts, form)
