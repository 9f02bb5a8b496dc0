"""Networks of plans for boxes of parameter values: strong controllability, and what a box has to give up.

A duration `end − start in [γ, γ]` is a contingent link: nature chooses γ in ρ(γ), and the end reveals it. So is any
other link that an expression over parameters fixes, such as a start time `start − .zero in [γ, γ]`. A parameter in a
bound that leaves room is never revealed by the network; there, the worst value in the box counts.

Strong controllability is one schedule of what the dispatcher executes that suits all lengths that nature may choose.
Each time point happens at an expression over parameters after the last time point before it that the dispatcher
executes. So each requirement is a difference between two such time points that has to be at least the worst value of an
expression over the box, and strong controllability is consistency of a simple temporal network (Vidal and Fargier,
1999). This decides it exactly, also if several links share a parameter or requirements mention some: nothing is
revealed to a fixed schedule.

Boxes that are dynamically or strongly controllable are found exactly. Both properties get lost as a box grows, and each
reason for it is a conjunction of linear inequalities over the ends of the box: the pieces of a semi-reducible negative
cycle are negative, or the worst values of some requirements add up. So a reason stops growing faces as a bad polyhedron
does: it says exactly how far they go. Exact widening (:mod:`robust.irr.widen`) then needs to know nothing else of it;
there is no bisection and no tolerance.

A box is shrunk to its controllable part by widening inside it: all faces move outwards from the nominal point together,
each at the speed of its parameter's weight, up to where they stood; those that reasons block stay, the others move on.
The result is max–min fair, and no controllable box between it and the given one contains it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

from robust import errors, presented
from robust.irr.widen import BadSet, Obstacle, Widening, faces_of
from robust.network.differences import Distances
from robust.network.uncertain import DynamicAnswer, EdgeStep, Stnu, UncertainLink, dynamic
from robust.plan import model
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box, Face, Growing, Side
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import NEVER, Deadline

Length = Polynomial[str]
"""A linear expression over parameters."""
Form = Polynomial[Face]
"""A linear expression over the ends of a box."""
Ends = Mapping[Face, Fraction | None]
"""Where the faces of a box stand; None is infinitely far out. Whether an end belongs to the box makes no difference to
controllability: constraints of networks include their bounds."""

NOTHING = (Fraction(0), Fraction(0))
"""Zero, as :func:`value` has it."""
_NOTHING: Length = Polynomial({})
_NO_FORM: Form = Polynomial({})


def ends_of(box: Box) -> dict[Face, Fraction | None]:
    """Both ends of every interval."""
    return {(name, side): interval.end(side) for name, interval in box.intervals.items() for side in Side}


def least(length: Length) -> Form:
    """The least value of an expression in a box, over the box's ends."""
    terms: dict[tuple[Face, ...], Fraction] = {(): length.constant_term}
    for name, factor in length.coefficients():
        terms[(name, Side.LOWER if factor > 0 else Side.UPPER),] = factor
    return Polynomial(terms)


def greatest(length: Length) -> Form:
    """The greatest value of an expression in a box, over the box's ends."""
    return -least(-length)


def value(form: Form, ends: Ends) -> tuple[Fraction, Fraction]:
    """A form's value as (how often infinity, the rest): faces that are infinitely far out are equally far."""
    infinite, finite = Fraction(0), form.constant_term
    for face, factor in form.coefficients():
        end = ends[face]
        if end is None:
            infinite += factor * face[1].sign
        else:
            finite += factor * end
    return infinite, finite


ParametricLink = UncertainLink[Length]
"""A link whose bounds are expressions over parameters; both are the length if it is contingent."""


def variables_of(link: ParametricLink) -> frozenset[str]:
    """The parameters that a link mentions."""
    return frozenset(name for bound in (link.lower, link.upper) if bound is not None for name in bound.variables)


@dataclass(frozen=True)
class ParametricStnu:
    """A plan's network for every box in which its contingent links stay legal.

    `vague` are parameters that a network with uncertainty cannot express, with the reason: what is dynamically
    controllable if they are independent and never revealed is so, but not the other way round.
    """

    points: tuple[model.TimePoint, ...]
    links: tuple[ParametricLink, ...]
    vague: Mapping[str, str]
    _answers: dict[frozenset[tuple[Face, Fraction | None]], DynamicAnswer] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def dynamic(self, ends: Ends, deadline: Deadline = NEVER) -> DynamicAnswer:
        """Whether the network of a box is dynamically controllable; each box is asked about once.

        Raises:
            InputError: as for :meth:`at`.
            OutOfTimeError: if the deadline passes first.
        """
        asked = frozenset(ends.items())
        if asked not in self._answers:
            self._answers[asked] = dynamic(self.at(ends), deadline)
        return self._answers[asked]

    def at(self, ends: Ends) -> Stnu:
        """The network of a box.

        Raises:
            InputError: if a contingent link may end before it starts (see :meth:`early`), or a requirement cannot be
                met because a face is infinitely far out (see :meth:`endless`).
        """
        endless = self.endless(ends)
        if endless:
            names = ", ".join(sorted({name for name, _ in endless}))
            raise errors.InputError(f"a requirement becomes infinitely strong; expected finite ends for {names}")
        pairs = zip(self.links, self._fixed, strict=True)
        return Stnu(self.points, tuple(fixed or _concrete(link, ends) for link, fixed in pairs))

    @cached_property
    def _fixed(self) -> Sequence[UncertainLink[Fraction] | None]:
        """The links that are the same for every box."""
        return [_concrete(link, {}) if is_constant(link) else None for link in self.links]

    def early(self, ends: Ends) -> Iterator[tuple[int, Form]]:
        """Contingent links that may end before they start in a box, by index, with the form that is negative.

        One whose length is fixed is no matter of uncertainty, and not among them.
        """
        for index, link in enumerate(self.links):
            if link.is_contingent and link.lower is not None and not link.lower.is_constant:
                low, high = _extreme(Side.LOWER, link.lower, ends), _extreme(Side.UPPER, link.lower, ends)
                if low is None or (low < 0 and low != high):
                    yield index, least(link.lower)

    def endless(self, ends: Ends) -> frozenset[Face]:
        """Faces that are infinitely far out and make a bound of a requirement infinitely strong: none may be."""
        faces: set[Face] = set()
        for link in self.links:
            for extreme, bound in ((greatest, link.lower), (least, link.upper)):
                if bound is not None and not bound.is_constant and not link.is_contingent:
                    faces.update(face for face, _ in extreme(bound).coefficients() if ends[face] is None)
        return frozenset(faces)

    @cached_property
    def differences(self) -> tuple[WorstDifference, ...]:
        """The requirements with the worst lengths of contingent links, for every box."""
        into = {link.target: link for link in self.links if link.is_contingent}

        def place(point: model.TimePoint) -> tuple[model.TimePoint, Length]:
            offset = _NOTHING
            while point in into:
                link = into[point]
                offset = offset + (link.lower or 0)
                point = link.source
            return point, offset

        base = {point: place(point) for point in self.points}
        differences: dict[tuple[model.TimePoint, model.TimePoint, Form], WorstDifference] = {}
        for link in self.links:
            if not link.is_contingent:
                (a, before), (b, after) = base[link.source], base[link.target]
                sides = [] if link.lower is None else [(a, b, greatest(link.lower + before - after))]
                sides += [] if link.upper is None else [(b, a, greatest(after - before - link.upper))]
                for side in sides:
                    differences.setdefault(side, WorstDifference(*side, link.origin))
        return tuple(differences.values())

    def without_implied_orders(self, times: Mapping[model.TimePoint, Fraction]) -> ParametricStnu:
        """The network without constant least distances that two others imply; those longest at some `times` go first.

        It has the same schedules, and so is as controllable.
        """
        after: dict[model.TimePoint, dict[model.TimePoint, Fraction]] = {point: {} for point in self.points}
        orders = []
        for link in self.links:
            if not link.is_contingent and link.upper is None and link.lower is not None and link.lower.is_constant:
                orders.append(link)
                known = after[link.source].get(link.target, link.lower.constant_term)
                after[link.source][link.target] = max(known, link.lower.constant_term)
        implied = set()
        for link in sorted(orders, key=lambda link: times[link.source] - times[link.target]):
            (source, target), need = (link.source, link.target), after[link.source].get(link.target)
            ways = ((first, after[via].get(target)) for via, first in after[source].items())
            if need is not None and any(rest is not None and first + rest >= need for first, rest in ways):
                implied.add((source, target))
                del after[source][target]
        links = (link for link in self.links if link not in orders or (link.source, link.target) not in implied)
        return ParametricStnu(self.points, tuple(links), self.vague)

    def form(self, step: EdgeStep) -> Form:
        """The weight of an edge of the distance graph, over the ends of a box: never more in a larger box."""
        link = self.links[step.link]
        bound = link.upper if step.way.is_forwards else link.lower
        if bound is None:
            raise ValueError(f"{link.origin} has no bound {step.way.value}")
        return least(bound) if step.way.is_forwards else -greatest(bound)


def is_constant(link: ParametricLink) -> bool:
    return (link.lower is None or link.lower.is_constant) and (link.upper is None or link.upper.is_constant)


def _concrete(link: ParametricLink, ends: Ends) -> UncertainLink[Fraction]:
    if not link.is_contingent:
        lower = None if link.lower is None else _extreme(Side.UPPER, link.lower, ends)
        upper = None if link.upper is None else _extreme(Side.LOWER, link.upper, ends)
        return UncertainLink(link.source, link.target, lower, upper, origin=link.origin)
    length = link.lower or _NOTHING
    low, high = _extreme(Side.LOWER, length, ends), _extreme(Side.UPPER, length, ends)
    if low is not None and low == high and low < 0:
        return UncertainLink(link.source, link.target, low, low, origin=link.origin)
    if low is None:
        raise errors.InputError(f"contingent link {link.origin} has no least length; expected one of at least 0")
    return UncertainLink(link.source, link.target, low, high, True, str(length), link.origin)


def _extreme(side: Side, length: Length, ends: Ends) -> Fraction | None:
    """The least or the greatest value in the box; None if it is infinite."""
    total = length.constant_term
    for name, factor in length.coefficients():
        end = ends[name, side if factor > 0 else side.opposite]
        if end is None:
            return None
        part = end if factor == 1 else factor * end
        total = total + part if total else part
    return total


# -- from a plan -----------------------------------------------------------------------------------------------------


def parametric_stnu(plan: model.ParametrizedPlan, box: Box) -> ParametricStnu:
    """The network of a plan, its contingent links oriented such that they have a length in the box.

    Raises:
        UnsupportedError: for a bound that is not linear in the parameters.
    """
    bounds = list(_bounds(plan))
    fixed = [bound for bound in bounds if bound.lower is not None and bound.lower == bound.upper]
    contingent = _contingent(plan, fixed, box)
    links = [
        *contingent.values(),
        *(bound for bound in bounds if id(bound) not in contingent),
        *(ParametricLink(model.ZERO, p, _NOTHING, None, origin=f"{p} ≥ 0") for p in plan.time_points[1:]),
    ]
    return ParametricStnu(plan.time_points, tuple(links), _vague(links, box))


def _bounds(plan: model.ParametrizedPlan) -> Iterator[ParametricLink]:
    """Every bound of the network; a lower and an upper bound that are equal make one link."""
    for point in plan.time_points:
        if point.kind is model.TimePointKind.TIMED_LITERAL:
            time: Length = Polynomial.constant(point.time or Fraction(0))
            yield ParametricLink(model.ZERO, point, time, time, origin=f"timed initial literal {point}")
    for item in plan.constraints:
        lower = None if item.lower is None else _length(item.lower)
        upper = None if item.upper is None else _length(item.upper)
        yield ParametricLink(item.source, item.target, lower, upper, origin=str(item))


def _length(bound: model.Bound) -> Length:
    if not bound.is_linear:
        raise errors.UnsupportedError(f"the bound {bound} of a temporal constraint is not linear in the parameters")

    def named(variable: model.NumericVariable) -> Length:
        if not isinstance(variable, model.ParameterReference):
            raise TypeError(f"a temporal constraint can only mention parameters, not {variable}")
        return Polynomial.variable(variable.name)

    return bound.substitute(named)


def _contingent(plan: model.ParametrizedPlan, fixed: Iterable[ParametricLink], box: Box) -> dict[int, ParametricLink]:
    """Which of the links that fix a distance are contingent, by identity: at most one into each time point, no circles.

    Durations of instances come first, also constant ones: the end of an action comes by itself.
    """
    duration = {(instance.start, instance.end) for instance in plan.instances if instance.durative}
    chosen: dict[int, ParametricLink] = {}
    before: dict[model.TimePoint, model.TimePoint] = {}
    oriented = [(id(bound), _oriented(bound, duration, box)) for bound in fixed]
    oriented.sort(key=lambda pair: (pair[1].source, pair[1].target) not in duration)
    for key, link in oriented:
        is_duration = (link.source, link.target) in duration
        varies = link.lower is not None and not link.lower.is_constant
        free = link.target.kind not in {model.TimePointKind.ZERO, model.TimePointKind.TIMED_LITERAL}
        if (is_duration or varies) and free and link.target not in before and not _follows(link, before):
            before[link.target] = link.source
            chosen[key] = link
    return chosen


def _oriented(link: ParametricLink, duration: set[tuple[model.TimePoint, model.TimePoint]], box: Box) -> ParametricLink:
    """The link as a contingent one: from what happens first."""
    length = link.lower or _NOTHING
    turned = (link.target, link.source) in duration
    if (link.source, link.target) not in duration and not turned:
        turned = value(greatest(length), ends_of(box)) <= NOTHING
    source, target, length = (link.target, link.source, -length) if turned else (link.source, link.target, length)
    return ParametricLink(source, target, length, length, True, origin=link.origin)


def _follows(link: ParametricLink, before: Mapping[model.TimePoint, model.TimePoint]) -> bool:
    """Whether the link's source happens because of its target."""
    point = link.source
    while point != link.target and point in before:
        point = before[point]
    return point == link.target


def _vague(links: Iterable[ParametricLink], box: Box) -> dict[str, str]:
    lengths: Counter[str] = Counter()
    bounds: Counter[str] = Counter()
    for link in links:
        (lengths if link.is_contingent else bounds).update(variables_of(link))
    reasons = {}
    for name, interval in box.intervals.items():
        if interval.width == 0:
            continue
        if bounds[name]:
            reasons[name] = f"{name} stands in a bound, and the network does not say what reveals it"
        elif lengths[name] > 1:
            reasons[name] = f"{name} is the length of {lengths[name]} links, the first of which reveals the others"
    return reasons


@dataclass(frozen=True, slots=True)
class WorstDifference:
    """`t_target − t_source ≥ form` between time points that the dispatcher executes; `origin` is the requirement."""

    source: model.TimePoint
    target: model.TimePoint
    form: Form
    origin: str


@dataclass(frozen=True)
class StrongAnswer(presented.NoTruthValue, ask="is_controllable"):
    """A schedule of the dispatcher's time points, or a cycle of differences whose sum is positive.

    `endless` are faces that are infinitely far out although a difference grows with them: each may be at any finite
    place as far as that difference is concerned, but not infinitely far out.
    """

    schedule: Mapping[model.TimePoint, Fraction] | None
    cycle: tuple[WorstDifference, ...]
    endless: frozenset[Face]

    @property
    def is_controllable(self) -> bool:
        return self.schedule is not None


def strong(network: ParametricStnu, ends: Ends) -> StrongAnswer:
    """The earliest schedule that is valid for all parameter values in a box with these ends, or why there is none."""
    needed = network.differences
    endless = frozenset(face for need in needed for face, _ in need.form.coefficients() if ends[face] is None)
    if endless:
        first = next(need for need in needed if any(face in endless for face, _ in need.form.coefficients()))
        return StrongAnswer(None, (first,), endless)
    points = dict.fromkeys(point for need in needed for point in (need.source, need.target))
    known = Distances(points, ((need.source, need.target, value(need.form, ends)[1]) for need in needed))
    if known.network.cycle is not None:
        return StrongAnswer(None, tuple(needed[origin] for origin in known.network.cycle.origins), frozenset())
    times = known.times
    return StrongAnswer({point: time - times[network.points[0]] for point, time in times.items()}, (), frozenset())


HORIZON = Fraction(1_000_000)
"""Largest distance, in units of its weight, that a face moves which may be at any finite place but not infinite."""

Reason = tuple[Form, ...]
"""A box is not controllable if all these forms over its ends are negative."""


@dataclass(frozen=True)
class Dynamically:
    """Dynamic controllability; parameters that the network is vague about are taken to be independent and hidden."""

    network: ParametricStnu
    deadline: Deadline

    def endless(self, ends: Ends) -> frozenset[Face]:
        return self.network.endless(ends)

    def reason(self, ends: Ends) -> Reason | None:
        for _, form in self.network.early(ends):
            return (form,)
        answer = self.network.dynamic(ends, self.deadline)
        if answer.cycle is None:
            return None
        return tuple(sum(map(self.network.form, piece), _NO_FORM) for piece in answer.cycle.pieces)


@dataclass(frozen=True)
class Strongly:
    """Strong controllability."""

    network: ParametricStnu
    deadline: Deadline

    def endless(self, ends: Ends) -> frozenset[Face]:
        return strong(self.network, ends).endless

    def reason(self, ends: Ends) -> Reason | None:
        self.deadline.enforce()
        answer = strong(self.network, ends)
        return None if answer.is_controllable else (-sum((edge.form for edge in answer.cycle), _NO_FORM),)


Property = Dynamically | Strongly
"""A property of boxes that every box inside inherits.

`endless` are faces that must not be infinitely far out, however the others stand; `reason` is why a box does not have
the property.
"""


# -- boxes that grow ---------------------------------------------------------------------------------------------------


def _face_order(face: Face) -> tuple[str, str]:
    return face[0], face[1].value


@dataclass(frozen=True)
class Obstruction:
    """A reason why boxes are not controllable, as an obstacle for growing boxes."""

    forms: Reason
    exact = True

    @property
    def slabs(self) -> Obstruction:
        return self

    @cached_property
    def mentioned(self) -> frozenset[str]:
        return frozenset(name for form in self.forms for (name, _), _ in form.coefficients())

    @property
    def faces(self) -> set[Face]:
        return {face for form in self.forms for face, _ in form.coefficients()}

    @property
    def rooms(self) -> list[tuple[Mapping[Face, Fraction], Fraction]]:
        """The forms as coefficients and constants; a box is controllable if one of them is not negative."""
        return [(dict(form.coefficients()), form.constant_term) for form in self.forms]

    def meets(self, box: Box) -> bool:
        ends = ends_of(box)
        return all(value(form, ends) < NOTHING for form in self.forms)

    def least_stretch(self, growing: Growing) -> tuple[Fraction, bool] | None:
        """Forms fall as a box grows; the box meets the reason when the last of them has become negative."""
        ends = {**ends_of(growing.box), **{face: base for face, (base, _) in growing.moving.items()}}
        greatest, attained = Fraction(0), True
        for form in self.forms:
            room = value(form, ends)
            if room < NOTHING:
                continue
            speed = sum(
                (-factor * face[1].sign * growing.moving[face][1] for face, factor in form.coefficients()
                 if face in growing.moving),
                Fraction(0),
            )  # fmt: skip
            if not speed:
                return None
            if room[1] / speed >= greatest:
                greatest, attained = room[1] / speed, False
        return greatest, attained


@dataclass(eq=False)
class GrowingBox:
    """A box that grows inside of another set as long as it has a property; widening asks it what stops it.

    Args:
        inside: what a box must not meet.
        wanted: what it has to have.
        parameters: the parameters, with weights.
        box: where growing begins: faces that must stay finite go no farther than :data:`HORIZON` weights from there;
            later, the widest box so far.
        met: what boxes are known to run into, to which all that they run into is added.
        fixed: parameters whose faces stay.
    """

    inside: BadSet
    wanted: Property
    parameters: Sequence[model.Parameter]
    box: Box
    met: list[Obstacle]
    fixed: Collection[str] = ()

    def __post_init__(self) -> None:
        self._weight = {parameter.name: parameter.weight for parameter in self.parameters}
        self._start = self.box
        self._horizon: dict[Face, Fraction] = {}
        """Where faces end that could be at any finite place, but must not be infinite."""

    def piece_in(self, box: Box, deadline: Deadline) -> Obstacle | None:
        ends = ends_of(box)
        endless = min(self.wanted.endless(ends), key=_face_order, default=None)
        if endless is not None:
            return self._beyond(endless)
        reason = self.wanted.reason(ends)
        return self.inside.piece_in(box, deadline) if reason is None else Obstruction(reason)

    def _beyond(self, face: Face) -> Polyhedron:
        name, side = face
        end = (self._start[name].end(side) or 0) + side.sign * HORIZON * self._weight[name]
        self._horizon[face] = end
        return Polyhedron(tuple(self._weight), (LinearConstraint.of({name: side.sign}, ">", side.sign * end),))

    def cut(self, box: Box) -> tuple[Face, ...]:
        """The faces of a box that could be at any finite place, but must not be infinite."""
        faces = (face for face, end in self._horizon.items() if box[face[0]].end(face[1]) == end)
        return tuple(sorted(faces, key=_face_order))

    @property
    def _moving(self) -> dict[Face, Fraction]:
        """The finite faces that may move, and where they are."""
        faces = (face for face in faces_of(self.parameters) if face[0] not in self.fixed)
        ends = (((name, side), self.box[name].end(side)) for name, side in faces)
        return {face: end for face, end in ends if end is not None}

    def grow(self, deadline: Deadline) -> None:
        """Move the faces of the box outwards together until each is stopped.

        No box around the last one is as wanted, but for faces of fixed parameters, which do not move.

        Raises:
            OutOfTimeError: if the deadline passes first; the box is then as wide as it has become.
        """

        def keep(box: Box) -> None:
            self.box = box

        groups = [list(self._moving)]
        Widening(
            bad=self, parameters=self.parameters, pieces=self.met, groups=groups, deadline=deadline, on_box=keep,
            start=self.box,
        ).run()  # fmt: skip

    def leap(self, deadline: Deadline) -> None:
        """Widen the box in one step, for want of time: faces that nothing stops move together, most of the way that
        they may.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        free = {face: (end, self._weight[face[0]]) for face, end in self._moving.items()}
        growing, room, unknown = Growing(self.box, free), Fraction(2), list(self.met)
        while True:
            while unknown and free:  # what was met last is first: nothing else has to be looked at where it stops all
                piece = unknown.pop()
                least = piece.slabs.least_stretch(growing)
                if least is not None and least[0] == 0:
                    free = {face: free[face] for face in free.keys() - piece.slabs.faces}
                elif least is not None:
                    room = min(room, least[0])
            if not free:
                return
            ends: Ends = {face: base + face[1].sign * _SHARE * room * speed for face, (base, speed) in free.items()}
            box = self.box.with_faces(ends)
            found = self.piece_in(box, deadline)
            if found is None:
                self.box = box
                return
            self.met.append(found)
            growing, unknown = Growing(self.box, free), [found]


_SHARE = Fraction(7, 8)
"""How far faces leap, of the way to what stops the first of them."""


@dataclass(frozen=True)
class KnownSet:
    """Bad polyhedra all of which are known."""

    pieces: tuple[Polyhedron, ...]

    def piece_in(self, box: Box, deadline: Deadline) -> Polyhedron | None:
        deadline.enforce()
        return next((piece for piece in self.pieces if piece.meets(box)), None)


@dataclass(frozen=True, slots=True)
class Shrunk:
    """A controllable part of a box; `cut` are its faces that may be at any finite place, but not infinitely far out."""

    box: Box
    cut: tuple[Face, ...]


def shrink(parameters: Sequence[model.Parameter], box: Box, wanted: Property) -> Shrunk:
    """The max–min fair part of a box around the nominal point that has a property; see the module's text.

    Where the nominal value is outside the box, faces move from the middle of the interval instead.

    Raises:
        InputError: if not even the point that faces start from has the property: it has no schedule.
        OutOfTimeError: if the property's deadline passes.
    """
    ends = ends_of(box)
    if not wanted.endless(ends) and wanted.reason(ends) is None:
        return Shrunk(box, ())
    nominal = {parameter.name: parameter.nominal for parameter in parameters}
    start = Box.point({name: box[name].some_value() if at not in box[name] else at for name, at in nominal.items()})
    if wanted.reason(ends_of(start)) is not None:
        raise errors.InputError("the plan's network has no schedule at the nominal values")
    beyond = [Polyhedron(tuple(nominal), (half,)) for side in box.constraints() for half in side.negation()]
    growing = GrowingBox(KnownSet(tuple(beyond)), wanted, parameters, start, [*beyond])
    growing.grow(wanted.deadline)
    return Shrunk(growing.box, growing.cut(growing.box))


@dataclass(frozen=True, slots=True)
class Loss:
    """The loss of width of a box: by face, and as a share of the total width; None is infinite.

    `share` is None if the total width was infinite.
    """

    faces: Mapping[Face, Fraction | None]
    share: Fraction | None


def loss(box: Box, shrunk: Box) -> Loss:
    """The loss of replacing a box by one inside it."""
    after = ends_of(shrunk)
    faces: dict[Face, Fraction | None] = {}
    for face, old in ends_of(box).items():
        new = after[face]
        finite = None if old is None or new is None else abs(old - new)
        faces[face] = Fraction(0) if old == new else finite
    wide, narrow = box.total_width, shrunk.total_width
    share = None if wide is None or narrow is None else ((wide - narrow) / wide if wide else Fraction(0))
    return Loss(faces, share)
