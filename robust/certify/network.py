"""Orders of time points that a network implies for all parameter values in a region, and schedules over regions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from heapq import heappop, heappush
from math import lcm
from typing import Any

from robust.certify.checker.formulas import Formulas, constant, plus, replaced
from robust.certify.checker.reader import Ground, Linear
from robust.certify.hints import Fact
from robust.encode.variables import Auxiliary, Range, variable
from robust.encode.variables import constant as term_of
from robust.errors import RefutedError
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms

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


class Orders:
    """Greatest lower bounds of distances between time points, each constraint at its least over the parameters' ranges.

    It stands for the checker's table of known orders, and remembers which of them decided something.

    Raises:
        RefutedError: if the constraints contradict each other for all values.
    """

    def __init__(self, ground: Ground, ranges: Mapping[str, Range]) -> None:
        self._ground = ground
        floors = ((number, a, b, least(w, ranges)) for number, (a, b, w) in enumerate(ground.edges))
        found = [(number, a, b, floor) for number, a, b, floor in floors if floor is not None and a != b]
        self._unit = lcm(*(floor.denominator for *_, floor in found))
        self._edges = [(number, a, b, int(floor * self._unit)) for number, a, b, floor in found]
        self._times = self._least_times()
        self._following: list[list[tuple[int, int, int]]] = [[] for _ in ground.points]
        for number, a, b, floor in self._edges:
            self._following[a].append((b, self._times[b] - self._times[a] - floor, number))
        self._rows: dict[int, dict[int, tuple[int, int, int]]] = {}
        self._used: dict[tuple[int, int], Fraction] = {}

    def _least_times(self) -> list[int]:
        times = [0] * len(self._ground.points)
        for _ in range(len(times) + 1):
            changed = False
            for _, a, b, floor in self._edges:
                if times[a] + floor > times[b]:
                    times[b], changed = times[a] + floor, True
            if not changed:
                return times
        raise RefutedError("the network allows no schedule for any of these values; expected some")

    def _row(self, source: int) -> dict[int, tuple[int, int, int]]:
        """For each point: the least slack of a path to it, the point before it on that path, and the constraint."""
        row = self._rows.get(source)
        if row is None:
            row = self._rows[source] = {}
            heap = [(0, source, source, -1)]
            while heap:
                slack, point, before, number = heappop(heap)
                if point not in row:
                    row[point] = (slack, before, number)
                    for other, more, edge in self._following[point]:
                        if other not in row:
                            heappush(heap, (slack + more, other, point, edge))
        return row

    def get(self, pair: tuple[int, int], default: Any = None) -> Any:
        """At least this much after the first point is the second; as a dictionary's."""
        a, b = pair
        if self._times[b] < self._times[a]:
            return default  # the least schedule contradicts any distance that would matter
        found = self._row(a).get(b)
        if found is None or a == b:
            return default
        distance = self._times[b] - self._times[a] - found[0]
        if distance < 0:
            return default
        self._used[pair] = Fraction(distance, self._unit)
        return self._used[pair]

    def lemmas(self) -> Iterator[tuple[int, int, list[int], Fraction, Linear]]:
        """For each order that was asked for: its points, its path of constraints and earlier lemmas, its length, and
        by how much the path may be longer."""
        edges, numbers = self._ground.edges, dict[tuple[int, int], int]()
        ordered = sorted(self._used, key=lambda pair: (pair[0], self._row(pair[0])[pair[1]][0], self._times[pair[1]]))
        pending = dict.fromkeys(ordered)
        while pending:
            source = next(iter(pending))[0]
            batch = [pair for pair in pending if pair[0] == source]
            row = self._row(source)
            for pair in sorted(batch, key=lambda pair: self._depth(row, pair[1], source)):
                del pending[pair]
                path, total, place = list[int](), Linear(), pair[1]
                while place != source:
                    if (source, place) in numbers:
                        path.append(len(edges) + numbers[source, place])
                        total = plus(total, constant(self._used[source, place]))
                        break
                    _, place, edge = row[place]
                    path.append(edge)
                    total = plus(total, edges[edge][2])
                bound = self._used[pair]
                numbers[pair] = len(numbers)
                yield *pair, path[::-1], bound, plus(total, constant(bound), -1)

    @staticmethod
    def _depth(row: Mapping[int, tuple[int, int, int]], point: int, source: int) -> int:
        depth = 0
        while point != source:
            point, depth = row[point][1], depth + 1
        return depth


def constant_times(formulas: Formulas, ranges: Mapping[str, Range]) -> dict[str, Linear] | None:
    """The earliest times of free time points that suit the worst value of each constraint; None if there are none."""
    ground = formulas.ground
    split = {point: _split(tie) for point, tie in formulas.ties.items()}
    edges: list[tuple[str, str, Fraction]] = []
    for a, b, w in ground.edges:
        (source, before), (target, after) = split[a], split[b]
        slack = least(plus(plus(after, before, -1), w, -1), ranges)
        if slack is None:
            return None
        edges.append((source, target, -slack))
    times = dict.fromkeys(["", *formulas.free()], Fraction(0))
    for _ in range(len(times) + 1):
        changed = False
        for source, target, weight in edges:
            if times[source] + weight > times[target]:
                if not target or source == target:
                    return None
                times[target], changed = times[source] + weight, True
        if not changed:
            return {point: constant(times[point]) for point in formulas.free()}
    return None


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
    if verdict is Verdict.UNKNOWN:
        raise OutOfTimeError
    if verdict is Verdict.UNSATISFIABLE:
        return None
    values = session.values([terms.real(each) for term in sought.values() for each in term.variables])
    found: dict[str, Linear] = {point: {} for point in formulas.free()}
    for (point, column), term in sought.items():
        value = Fraction(values.get(str(next(iter(term.variables))), 0))
        if value:
            found[point][column] = value
    return found


def placed(formulas: Formulas, times: Mapping[str, Linear]) -> list[Linear]:
    """The slack of each constraint of the network at these times."""
    return [replaced(formulas.slack(edge), times) for edge in formulas.ground.edges]


def evaluated(form: Linear, point: Point) -> Fraction:
    return sum((factor * (point[name] if name else 1) for name, factor in form.items()), Fraction(0))


def positive_circle(ground: Ground, point: Point) -> list[int] | None:
    """Constraints in a circle that no times keep at one point of parameter space; None if there is a schedule."""
    exact = [evaluated(w, point) for _, _, w in ground.edges]
    unit = lcm(*(length.denominator for length in exact))
    lengths = [int(length * unit) for length in exact]
    times = [0] * len(ground.points)
    arrival: dict[int, int] = {}
    last: int | None = None
    for _ in range(len(times) + 1):
        last = None
        for number, (a, b, _) in enumerate(ground.edges):
            if times[a] + lengths[number] > times[b]:
                times[b] = times[a] + lengths[number]
                arrival[b], last = number, b
        if last is None:
            return None
    place = last or 0
    for _ in times:
        place = ground.edges[arrival[place]][0]
    first, circle = place, list[int]()
    while not circle or place != first:
        circle.append(arrival[place])
        place = ground.edges[arrival[place]][0]
    return circle[::-1]
