"""Why parameter values are not in the envelope: circles of constraints, and schedules that break an obligation.

A schedule that is linear on a whole polyhedron comes from one vertex: the constraints that are tight there determine
all times as functions of the parameters, and the polyhedron is where these functions keep the other constraints (the
critical region of a parametric linear program [Gal and Nedoma 1972]).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from math import lcm
from typing import Any

from robust.certify import tape
from robust.certify.checker.claims import SEGMENT
from robust.certify.checker.formulas import FALSE, Formulas, plus, replaced
from robust.certify.checker.reader import Ground, Linear, constant
from robust.certify.hints import Fact, KnownFacts, Line, LinearSide, Model, SolverModels, implied, model, refutation
from robust.encode.interface import Encoding, Range
from robust.errors import UnsupportedError
from robust.irr.templates import Shape
from robust.irr.widen import DiscoveredBadSet
from robust.qe import lifted, simplex
from robust.qe.box import Box, Interval
from robust.qe.box import Side as End
from robust.qe.conjunctions import without_spare
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region, outside
from robust.smt.limits import Deadline

MARGIN = "margin"
"""By how much strict constraints hold, at least; at most 1."""
REACH = 1
"""How far beyond a face bad values are looked for."""
NEGATIVE = "non-negative duration"
HALVINGS = 64
"""How often the way beyond a face is shortened in search of bad values near to it."""


def facts_of(constraints: Iterable[LinearConstraint]) -> list[Fact]:
    """The sides of a polyhedron, equations as two of them."""
    halves = [half for constraint in constraints for half in constraint.halves()]
    forms = (plus(constant(half.constant), {n: Fraction(f) for n, f in half.coefficients}, -1) for half in halves)
    return [(form, half.is_strict) for form, half in zip(forms, halves, strict=True)]


def side_of(form: Linear, strict: bool) -> LinearConstraint:
    """`form ≥ 0`, or `> 0`, as a side of a polyhedron."""
    factors = {name: -factor for name, factor in form.items() if name}
    return LinearConstraint.of(factors, Sense.LESS if strict else Sense.AT_MOST, form.get("", Fraction(0)))


class Reasons:
    """Finds out why parameter values are bad.

    Args:
        ground: the plan, as the checker reads it.
        epsilon: the separation of mutex time points.
        bounds: the declared bounds.
        deadline: when to give up, with OutOfTimeError.
    """

    def __init__(self, ground: Ground, epsilon: Fraction, bounds: Box, deadline: Deadline) -> None:
        self._ground = ground
        self._epsilon = epsilon
        self._names = tuple(ground.parameters)
        self._deadline = deadline
        self.formulas = Formulas(ground, epsilon)
        self.formulas.known = tape.OrderLemmas(ground, bounds.ranges)  # type: ignore[assignment]
        self._slacks = [self.formulas.slack(edge) for edge in ground.edges]
        self._network = KnownFacts([(slack, False) for slack in self._slacks])
        self._obligations = self.formulas.obligations()
        self._literals: dict[int, int] = {}
        self._first: dict[int, None] = {}  # those that broke, the last one last: they will elsewhere, too

    def breaking(
        self, assumed: Sequence[LinearSide], like: str = "", *, instants: bool = True
    ) -> tuple[int, Model] | None:
        """An obligation, by number, that some schedule breaks where the assumptions hold, and how.

        Those about the same as `like`, the name of one that may break as this package writes it, are tried first, and
        those about instants inside of actions not without `instants`.
        """
        if not like and instants:
            every = list(self._all_literals)
            negative = [number for number in every if self._obligations[number][0].endswith(NEGATIVE)]
            return self._broken_somewhere([[*negative, *reversed(self._first)], every], assumed)
        about = _about(like)
        tried = list(dict.fromkeys([*reversed(self._first), *range(len(self._obligations))]))
        tried.sort(key=lambda number: _about(self._obligations[number][0]) != about)
        if not instants:
            literals = self._all_literals
            tried = [number for number in tried if number in literals and f"!{number}" not in self.formulas.instants]
            alike = [number for number in tried if _about(self._obligations[number][0]) == about]
            return self._broken_somewhere([alike, tried], assumed)
        for number in tried:
            if number not in self._literals:
                self._literals[number] = self._obligations[number][1]()
            if self._literals[number] == FALSE:
                continue
            how = model(self.formulas, self._network, self._literals[number], self._deadline, assumed)
            if how is not None:
                self._first.pop(number, None)
                self._first[number] = None
                return number, how
        return None

    def _broken_somewhere(
        self, groups: Iterable[Sequence[int]], assumed: Sequence[LinearSide]
    ) -> tuple[int, Model] | None:
        """One of the obligations that breaks where the assumptions hold, and how, of the first group that has one.

        A negative duration is named before all else that breaks in the same schedule: to the verified checker, nothing
        changes continuously in less than no time.
        """
        literals = self._all_literals
        for listed in groups:
            group = sorted(listed, key=lambda number: not self._obligations[number][0].endswith(NEGATIVE))
            some = [literals[number] for number in group]
            found = self._models.model(some, self._deadline, assumed) if some else None
            if found is not None:
                number = group[some.index(found[0])]
                self._first.pop(number, None)
                self._first[number] = None
                return number, found[1]
        return None

    @cached_property
    def _all_literals(self) -> dict[int, int]:
        """What breaks each obligation, but for those that nothing breaks."""
        for number, (_, broken) in enumerate(self._obligations):
            if number not in self._literals:
                self._literals[number] = broken()
        return {number: literal for number, literal in sorted(self._literals.items()) if literal != FALSE}

    @cached_property
    def _models(self) -> SolverModels:
        return SolverModels(self.formulas, self._network, list(self._all_literals.values()))

    def piece(self, point: tape.Point, bounds: Sequence[Fact]) -> tuple[Polyhedron, list[Line]]:
        """A polyhedron of bad values around a point that is bad, and why: a line, and a refutation if it has one.

        Raises:
            UnsupportedError: if nothing is wrong there.
            OutOfTimeError: if the deadline passes.
        """
        known = self._circle(point, bounds)
        if known is not None:
            return known
        broken = self.breaking(_pins({name: point[name] for name in self._names}))
        if broken is None:
            raise UnsupportedError(f"nothing breaks at {dict(point)}, which is outside of the region")
        number, how = broken
        values, around = self._critical(how, point)
        around = self._widened(number, values, around, bounds, point)
        region = [*facts_of(around.constraints), *bounds]
        return around, [*self.broken(number, values, region, {})]

    def always(self, piece: Polyhedron, point: tape.Point, bounds: Sequence[Fact], like: str) -> list[Line]:
        """Say that every schedule of the network breaks something, perhaps what is `like` this, all over the polyhedron
        of a point.

        Raises:
            UnsupportedError: if some may be.
            OutOfTimeError: if the deadline passes.
        """
        region = [*facts_of(piece.constraints), *bounds]
        at = {name: point[name] for name in self._names}
        circle = self._circle(at, bounds)
        if circle is not None and circle[0].equals(piece):
            return circle[1]
        known = KnownFacts([*region, *((slack, False) for slack in self._slacks)])
        formulas = Formulas(self._ground, self._epsilon)
        numbers: list[int] = []
        # First what breaks with all else as it is at the point: that is nearly always enough.
        inside = {name for side in piece.constraints for name in side.parameters}
        for pins in (_pins({name: value for name, value in at.items() if name not in inside}), []):
            while (how := model(formulas, known, _none_broken(formulas, numbers), self._deadline, pins)) is not None:
                schedule = {name: value for name, value in how.point.items() if name in self._names or name[0] == "@"}
                broken = self.breaking(_pins(schedule), like, instants=False)
                if broken is None or broken[0] in numbers:
                    raise UnsupportedError(f"found a valid schedule of values outside of the region, like {at}")
                numbers.append(broken[0])
        formulas = Formulas(self._ground, self._epsilon)  # as the checker makes them
        return [["every", numbers], refutation(formulas, known, _none_broken(formulas, numbers), self._deadline)]

    def _circle(self, point: tape.Point, bounds: Sequence[Fact]) -> tuple[Polyhedron, list[Line]] | None:
        """A half-space around a point in which a circle of constraints leaves no schedule, and why."""
        circle = tape.positive_circle(self._ground, point)
        if circle is None:
            return None
        total: Linear = {}
        for number in circle:
            total = plus(total, self._ground.edges[number][2])
        around = Polyhedron(self._names, (side_of(total, True),))
        region = [*facts_of(around.constraints), *bounds]
        return around, [["cycle", circle, tape.sums(implied(KnownFacts(region), total, strictly=True))]]

    def _widened(
        self, number: int, values: Mapping[str, Linear], around: Polyhedron, bounds: Sequence[Fact], point: tape.Point
    ) -> Polyhedron:
        """The polyhedron without sides beyond which the same schedule breaks the obligation in another way; continuous
        effects that last some time at the point do so in all of it."""
        formulas, literal = self._placed(number, values, {})
        slacks = dict.fromkeys(tuple(sorted(formulas.slack(edge).items())) for edge in self._ground.edges)
        kept = [dict(slack) for slack in slacks if any(name for name, _ in slack)]
        sides = facts_of(around.constraints)
        if not self._obligations[number][0].endswith(NEGATIVE):
            gaps = [formulas.gap(a, b) for a, b, *_ in self._ground.flows]
            kept += (lasting := [gap for gap in gaps if gap.keys() - {""} and tape.evaluated(gap, point) >= 0])
            sides += [(gap, False) for gap in lasting]

        def is_spare(_: Fact, others: list[Fact]) -> bool:
            known = KnownFacts([*others, *bounds])
            return model(formulas, known, -literal, self._deadline) is None and all(map(known.imply, kept))

        needed = without_spare(sides, is_spare)
        return Polyhedron(self._names, tuple(side_of(form, strict) for form, strict in needed))

    def _placed(
        self, number: int, values: Mapping[str, Linear], parameters: Mapping[str, Linear]
    ) -> tuple[Formulas, int]:
        """The formulas at these times, and what breaks an obligation."""
        points = range(1, len(self._ground.points))
        given = {f"@{p}": replaced(replaced(self.formulas.ties[p], values), parameters) for p in points}
        if f"!{number}" in self.formulas.instants:
            given[f"!{number}"] = replaced(values.get(f"!{number}", {}), parameters)
        formulas = Formulas(self._ground, self._epsilon, {**parameters, **given})
        return formulas, formulas.obligations()[number][1]()

    def _critical(self, how: Model, point: tape.Point) -> tuple[dict[str, Linear], Polyhedron]:
        """Times and instants as functions of the parameters, and where they break the obligation in the same way."""
        wanted = [*(side.fact for side in how.sides), *((slack, False) for slack in self._slacks)]
        unknowns = list(dict.fromkeys(n for form, _ in wanted for n in form if n and n not in self._names))
        values = _vertex(wanted, unknowns, point)
        return values, _kept(self._names, wanted, values)

    def broken(
        self, number: int, values: Mapping[str, Linear], region: Sequence[Fact], parameters: Mapping[str, Linear]
    ) -> Iterator[Line]:
        """Say that a schedule breaks an obligation all over a region; `parameters` over the names of the region, if not
        their own."""
        formulas, literal = self._placed(number, values, parameters)
        known = KnownFacts(region)
        times = [tape.texts(formulas.ties[point]) for point in range(1, len(self._ground.points))]
        finder = tape.Multiples(region)
        kept = [tape.sums(finder.of(formulas.slack(edge))) for edge in self._ground.edges]
        instant = None
        if f"!{number}" in self.formulas.instants:
            instant = tape.texts(formulas.at(("instant", f"!{number}")))
        yield ["broken", number, times, kept, instant]
        yield refutation(formulas, known, -literal, self._deadline)


def _about(name: str) -> tuple[str, ...]:
    """What an obligation is about, as far as the checker's names and this package's are alike."""
    words = name.replace(":", " ").replace(",", " ").split()
    return tuple(words if words[:1] == ["separation"] else words[:1])


def _none_broken(formulas: Formulas, numbers: Sequence[int]) -> int:
    """The formula that none of these obligations is broken."""
    obligations = formulas.obligations()
    return formulas.circuit.all([-obligations[number][1]() for number in numbers])


def _pins(point: tape.Point) -> list[LinearSide]:
    """The formula that unknowns have these values."""
    signs = (Fraction(1), Fraction(-1))
    return [LinearSide.of({name: sign, "": -sign * value}, False) for name, value in point.items() for sign in signs]


def _vertex(wanted: Sequence[Fact], unknowns: Sequence[str], point: tape.Point) -> dict[str, Linear]:
    """The unknowns, over the parameters, at a vertex with the greatest margin of strict constraints."""
    place = {name: index for index, name in enumerate(unknowns)}
    tableau = simplex.Tableau(len(unknowns) + 1)

    for form, strict in wanted:
        row, level = [Fraction(0)] * (len(unknowns) + 1), Fraction(0)
        for name, factor in form.items():
            if name in place:
                row[place[name]] -= factor
            else:
                level += factor * (point[name] if name else 1)
        row[-1] += strict
        scale = lcm(level.denominator, *(factor.denominator for factor in row))
        tableau.add([int(factor * scale) for factor in row], Sense.AT_MOST, int(level * scale))

    tableau.add([0] * len(unknowns) + [1], Sense.AT_MOST, 1)
    if not tableau.restore():
        raise ValueError("the constraints of a model contradict each other")
    tableau.maximize([0] * len(unknowns) + [1])
    tight = (slack - len(unknowns) - 1 for slack in tableau.tight)
    return _solved([wanted[index] if index < len(wanted) else None for index in tight], unknowns)


def _solved(tight: Sequence[Fact | None], unknowns: Sequence[str]) -> dict[str, Linear]:
    """The unknowns, over the parameters, where constraints are tight; unknowns that these leave open are zero."""
    margin: Linear = {MARGIN: Fraction(1)}
    at_most = plus(margin, constant(Fraction(1)), -1)
    rows = [at_most if fact is None else plus(fact[0], margin, -1) if fact[1] else fact[0] for fact in tight]
    names = {*unknowns, MARGIN}
    solved: dict[str, Linear] = {}
    for equation in rows:
        row = replaced(equation, solved)
        pivot = next((name for name in row if name in names), None)
        if pivot is None:
            continue
        factor = row.pop(pivot)
        value = {name: -other / factor for name, other in row.items()}
        solved = {name: replaced(form, {pivot: value}) for name, form in solved.items()}
        solved[pivot] = value
    open_names = {name: Linear() for name in names if name not in solved}
    return {**open_names, **{name: replaced(form, open_names) for name, form in solved.items()}}


# -- regions ---------------------------------------------------------------------------------------------------------


def declared_bounds(ground: Ground) -> Box:
    """The declared bounds of the parameters, closed where finite."""
    ends = {name: (p.lower, p.upper) for name, p in ground.parameters.items()}
    return Box({name: Interval(low, high, low is not None, high is not None) for name, (low, high) in ends.items()})


def shape_lines(ground: Ground, epsilon: Fraction, shape: Shape, **conduct: Any) -> list[Line]:
    """Lines that say the plan is valid all over a shape; see :func:`robust.certify.tape.good_lines`."""
    inside = shape.polyhedron
    point = inside.interior_point() or inside.some_point() or {}
    hull = Box({name: inside.extent(name) or Interval(None, None) for name in inside.parameters})
    slanting = tuple(side for side in inside.constraints if len(side.parameters) > 1)
    stated = ["shape", _shown(Polyhedron(inside.parameters, slanting)), [str(point[name]) for name in hull.intervals]]
    good = tape.good_lines(ground, epsilon, hull, facts_of(slanting), **conduct)
    return [tape.header("shape", hull), stated, *good]


def region_lines(ground: Ground, epsilon: Fraction, region: Region, *, deadline: Deadline) -> list[Line]:
    """Lines that say a region is the whole envelope within the declared bounds: bad polyhedra, and all else good.

    Raises:
        RefutedError: if an obligation breaks somewhere in it.
        UnsupportedError: if it is not the whole envelope, or schedules cannot be written down.
        OutOfTimeError: if the deadline passes.
    """
    names, bounds = tuple(ground.parameters), declared_bounds(ground)
    everything = Polyhedron.of_box(names, bounds)
    limits = facts_of(everything.constraints)
    reasons = Reasons(ground, epsilon, bounds, deadline)
    lines: list[Line] = []
    removed: list[Polyhedron] = []
    for outer in region.complement().as_union().pieces:
        for point in uncovered(outer.intersection(everything), removed):
            deadline.enforce()
            piece, why = reasons.piece(point, limits)
            removed.append(piece)
            lines += [["bad", _shown(piece)], *why]
    good, covered = list(limits), list[Polyhedron]()
    for piece in removed:
        sides = facts_of(piece.constraints)
        if len(sides) == 1:
            good.append((plus({}, sides[0][0], -1), not sides[0][1]))
        else:
            covered.append(piece)
    base = Polyhedron(names, tuple(side_of(form, strict) for form, strict in good))
    formulas = Formulas(ground, epsilon)
    outside_of = [-_inside(formulas, piece) for piece in covered]
    lines += [["good"], *tape.obligation_lines(formulas, good, _ranges(base), outside_of, deadline=deadline)]
    for point in uncovered(base, covered):
        deadline.enforce()
        piece, times = _scheduled(formulas, point)
        covered.append(piece)
        outside_of.append(-_inside(formulas, piece))
        facts = [*facts_of(piece.constraints), *good]
        lines += [["piece", _shown(piece)], *tape.schedule_lines(formulas, facts, times)]
    return [*lines, ["rest"], refutation(formulas, KnownFacts(good), formulas.circuit.all(outside_of), deadline)]


def lifted_lines(ground: Ground, epsilon: Fraction, region: lifted.LiftedRegion, *, deadline: Deadline) -> list[Line]:
    """Lines that say a region with times is the envelope: what the network leaves a schedule and demands allow is good.

    No schedules are written down: linear ones would take a piece for each vertex of the network's polyhedron.
    """
    names, bounds = tuple(ground.parameters), declared_bounds(ground)
    limits = facts_of(Polyhedron.of_box(names, bounds).constraints)
    reasons = Reasons(ground, epsilon, bounds, deadline)
    lines: list[Line] = []
    good = list(limits)
    kept = [*region.constraints, *(side_of(*limit) for limit in limits)]
    for demand, origins in region.demanded.items():
        kept.remove(demand)
        for beyond in demand.negation():
            deadline.enforce()
            point = simplex.feasible_point((*names, *region.times), (*kept, beyond))
            if point is not None:
                piece = Polyhedron(names, (beyond,))
                why = reasons.always(piece, point, limits, origins[0] if origins else "")
                lines += [["bad", _shown(piece)], *why]
                good += [(plus({}, form, -1), not strict) for form, strict in facts_of(piece.constraints)]
                kept += beyond.negation()
    formulas = Formulas(ground, epsilon)
    ranges = _ranges(Polyhedron(names, tuple(side_of(form, strict) for form, strict in good)))
    proofs = tape.obligation_lines(formulas, good, ranges, (), deadline=deadline)
    return [*lines, ["good"], *proofs, ["network"]]


def _ranges(polyhedron: Polyhedron) -> dict[str, Range]:
    extents = ((name, polyhedron.extent(name)) for name in polyhedron.parameters)
    return {name: (e.lower, e.upper) if e is not None else (None, None) for name, e in extents}


def _shown(polyhedron: Polyhedron) -> Line:
    return [[tape.texts(form), strict] for form, strict in facts_of(polyhedron.constraints)]


def _inside(formulas: Formulas, piece: Polyhedron) -> int:
    return formulas.circuit.all([formulas.circuit.compare(*side) for side in facts_of(piece.constraints)])


def _scheduled(formulas: Formulas, point: tape.Point) -> tuple[Polyhedron, dict[str, Linear]]:
    """Times as functions of the parameters that keep the network around a point, and where they do."""
    slacks = [(formulas.slack(edge), False) for edge in formulas.ground.edges]
    solved = _vertex(slacks, formulas.free(), point)
    times = {name: solved[name] for name in formulas.free()}
    return _kept(tuple(formulas.ground.parameters), slacks, times), times


def _kept(names: tuple[str, ...], facts: Sequence[Fact], values: Mapping[str, Linear]) -> Polyhedron:
    """Where facts hold if unknowns are these functions of the parameters."""
    sides = ((replaced(form, values), strict) for form, strict in facts)
    constraints = dict.fromkeys(side_of(side, strict) for side, strict in sides if side.keys() - {""})
    return Polyhedron(names, tuple(constraints)).simplified()


def uncovered(everything: Polyhedron, cover: Sequence[Polyhedron]) -> Iterator[dict[str, Fraction]]:
    """Points that no polyhedron of a growing cover contains, until there are none.

    They are inside of what is not covered where that has an inside: what is true at a corner may be true nowhere else.
    """
    while (point := outside(everything, cover)) is not None:
        sides = [
            next(half for constraint in other.constraints for half in constraint.negation() if half.evaluate(point))
            for other in cover
        ]
        around = Polyhedron(everything.parameters, (*everything.constraints, *sides))
        yield around.interior_point() or point


# -- faces of boxes --------------------------------------------------------------------------------------------------


def face_lines(ground: Ground, encoding: Encoding, box: Box, *, solver: str, deadline: Deadline) -> Iterator[Line]:
    """For each face that is neither infinite nor a declared bound, bad values arbitrarily near to it.

    Raises:
        UnsupportedError: if none are found: the box is not maximal.
        OutOfTimeError: if the deadline passes.
    """
    bad = DiscoveredBadSet(encoding, solver=solver)
    bounds = declared_bounds(ground)
    reasons = cache(lambda: nearby(ground, encoding.epsilon, box, deadline=deadline))
    for name, interval in box.intervals.items():
        for side in (End.LOWER, End.UPPER):
            end = interval.end(side)
            if end is not None and not (interval.is_closed_at(side) and end == bounds[name].end(side)):
                yield from Face(ground, reasons, box, bad, name, side, end, deadline).lines()


def nearby(ground: Ground, epsilon: Fraction, box: Box, *, deadline: Deadline) -> Reasons:
    """Why values in a box are bad, and as far beyond its faces as bad ones are looked for."""
    wider = {
        name: Interval(None if low is None else low - REACH, None if high is None else high + REACH)
        for name, (low, high) in box.ranges.items()
    }
    return Reasons(ground, epsilon, Box(wider), deadline)


@dataclass(frozen=True, slots=True)
class Face:
    """One face of a box; `reasons` are the same for all of them."""

    ground: Ground
    reasons: Callable[[], Reasons]
    box: Box
    bad: DiscoveredBadSet
    name: str
    side: End
    end: Fraction
    deadline: Deadline

    def lines(self) -> Iterator[Line]:
        reach = self.end + REACH * self.side.sign
        for _ in range(HALVINGS):
            beyond = self._beyond(reach)
            piece = self.bad.piece_in(beyond, self.deadline)
            if piece is None:
                raise UnsupportedError(f"no bad values at the {self.side.value} end of {self.name}: it can be moved")
            points, broken = None, None
            if piece in self.bad.existence:
                points = self._nearest(piece.constraints, piece.parameters, beyond)
            else:
                assumed = [LinearSide.of(form, strict) for form, strict in facts_of(beyond.constraints())]
                broken = self.reasons().breaking(assumed, self.bad.reasons[piece])
                points = self._approach(broken[1], beyond) if broken is not None else None
            nearest = points[0][self.name] if points is not None else reach
            if points is not None and nearest == self.end:
                yield from self._circle(*points) if broken is None else self._schedule(broken[0], *points)
                return
            reach = (self.end + nearest) / 2
        raise UnsupportedError(f"no reason was found why the {self.side.value} end of {self.name} cannot be moved")

    def _beyond(self, reach: Fraction) -> Box:
        """What the box grows by if the face moves as far as `reach`, or if its end becomes part of it."""
        if not self.box[self.name].is_closed_at(self.side):
            return self.box.replace(self.name, Interval(self.end, self.end))
        if self.side is End.UPPER:
            return self.box.replace(self.name, Interval(self.end, reach, lower_closed=False))
        return self.box.replace(self.name, Interval(reach, self.end, upper_closed=False))

    def _nearest(
        self, constraints: Iterable[LinearConstraint], names: Iterable[str], beyond: Box
    ) -> tuple[tape.Point, tape.Point] | None:
        """The point of the closure that is nearest to the face, and one inside."""
        everything = Polyhedron(tuple(names), (*constraints, *beyond.constraints()))
        inside = everything.some_point()
        if inside is None:
            return None
        best = everything.maximize({self.name: Fraction(-self.side.sign)})
        if best is None or best.value is None:
            return None
        return (inside, inside) if best.point[self.name] == inside[self.name] else (best.point, inside)

    def _approach(self, how: Model, beyond: Box) -> tuple[tape.Point, tape.Point] | None:
        sides = [side_of(*side.fact) for side in how.sides]
        network = [side_of(self.reasons().formulas.slack(edge), False) for edge in self.ground.edges]
        network = [side for side in dict.fromkeys(network) if side.coefficients]
        names = {name for side in (*sides, *network) for name, _ in side.coefficients} | self.box.intervals.keys()
        return self._nearest([*sides, *network], sorted(names), beyond)

    def _segment(self, limit: tape.Point, inside: tape.Point) -> tuple[Line, list[Fact], dict[str, Linear]]:
        names = list(self.box.intervals)
        line = ["face", [str(limit[name]) for name in names], [str(inside[name]) for name in names]]
        region: list[Fact] = [({SEGMENT: Fraction(1)}, True), ({SEGMENT: Fraction(-1), "": Fraction(1)}, False)]
        return line, region, {name: _between(limit, inside, name) for name in names}

    def _circle(self, limit: tape.Point, inside: tape.Point) -> Iterator[Line]:
        step = Fraction(1)
        for _ in range(40):
            near = {name: limit[name] + step * (inside[name] - limit[name]) for name in self.box.intervals}
            line, region, given = self._segment(limit, near)
            circle = tape.positive_circle(self.ground, near)
            if circle is None:
                break
            total: Linear = {}
            for number in circle:
                total = plus(total, replaced(self.ground.edges[number][2], given))
            at_limit = total.get("", Fraction(0))
            if at_limit >= 0 and at_limit + total.get(SEGMENT, 0) > 0:
                yield line
                yield ["cycle", circle, tape.sums(implied(KnownFacts(region), total, strictly=True))]
                return
            step /= 1024
        raise UnsupportedError(f"no circle of constraints was found at the {self.side.value} end of {self.name}")

    def _schedule(self, number: int, limit: tape.Point, inside: tape.Point) -> Iterator[Line]:
        line, region, given = self._segment(limit, inside)
        values = {name: _between(limit, inside, name) for name in limit if name not in self.box.intervals}
        values |= {name: Linear() for name in self.reasons().formulas.free() if name not in values}
        yield line
        yield from self.reasons().broken(number, values, region, given)


def _between(limit: tape.Point, inside: tape.Point, name: str) -> Linear:
    return plus(constant(limit[name]), plus({}, {SEGMENT: inside[name] - limit[name]}))
