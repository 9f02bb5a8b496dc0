"""The network of a plan with parameters as lengths of contingent links, for boxes whose faces may move.

A duration `end − start in [γ, γ]` is a contingent link: nature chooses γ in ρ(γ), and the end reveals it. So is any
other link that an expression over parameters fixes, such as a start time `start − .zero in [γ, γ]`. A parameter in a
bound that leaves room is never revealed by the network; there, the worst value in the box counts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from robust.encode.network import describe
from robust.errors import InputError, UnsupportedError
from robust.execute.controllability.stnu import ContingentLink, Link, RequirementLink, Step, Stnu, Way
from robust.irr.box import Box, Side
from robust.irr.widen import Face
from robust.plan.model import ZERO, Bound, ParameterReference, ParametrizedPlan, TimePoint, TimePointKind
from robust.plan.polynomial import Polynomial

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


def ends_of(box: Box) -> dict[Face, Fraction | None]:
    """Both ends of every interval."""
    ends: dict[Face, Fraction | None] = {}
    for name, interval in box.intervals.items():
        ends[name, Side.LOWER], ends[name, Side.UPPER] = interval.lower, interval.upper
    return ends


def least(length: Length) -> Form:
    """The least value of an expression in a box, over the box's ends."""
    return _extreme(length, {True: Side.LOWER, False: Side.UPPER})


def greatest(length: Length) -> Form:
    """The greatest value of an expression in a box, over the box's ends."""
    return _extreme(length, {True: Side.UPPER, False: Side.LOWER})


def _extreme(length: Length, side: Mapping[bool, Side]) -> Form:
    terms: dict[tuple[Face, ...], Fraction] = {(): length.constant_term}
    for name, factor in length.coefficients():
        terms[(name, side[factor > 0]),] = factor
    return Polynomial(terms)


def value(form: Form, ends: Ends) -> tuple[Fraction, Fraction]:
    """A form's value as (how often infinity, the rest): faces that are infinitely far out are equally far."""
    infinite, finite = Fraction(0), form.constant_term
    for face, factor in form.coefficients():
        end = ends[face]
        if end is None:
            infinite += factor if face[1] is Side.UPPER else -factor
        else:
            finite += factor * end
    return infinite, finite


def finite_value(form: Form, ends: Ends) -> Fraction | None:
    """A form's value; None if it is infinite."""
    infinite, finite = value(form, ends)
    return None if infinite else finite


@dataclass(frozen=True, slots=True)
class ParametricLink:
    """A link whose bounds are expressions over parameters; None is infinite. Both are equal if it is contingent."""

    source: TimePoint
    target: TimePoint
    lower: Length | None
    upper: Length | None
    is_contingent: bool
    origin: str

    @property
    def ways(self) -> tuple[Way, ...]:
        """The edges of a requirement's bounds that are finite."""
        sides = ((Way.AT_LEAST, self.lower), (Way.AT_MOST, self.upper))
        return tuple(way for way, bound in sides if bound is not None)

    def form(self, way: Way) -> Form:
        """The weight of an edge of the distance graph, over the ends of a box: never more in a larger box.

        Raises:
            ValueError: if the link has no such bound.
        """
        bound = self.upper if way.is_forwards else self.lower
        if bound is None:
            raise ValueError(f"{self.origin} has no bound {way.value}")
        match way:
            case Way.LONGEST:
                return -greatest(bound)
            case Way.SHORTEST | Way.AT_MOST:
                return least(bound)
            case Way.AT_LEAST:
                return -greatest(bound)


@dataclass(frozen=True)
class ParametricStnu:
    """A plan's network for every box in which its contingent links stay legal.

    `vague` are parameters that a network with uncertainty cannot express, with the reason: what is dynamically
    controllable if they are independent and never revealed is so, but not the other way round.
    """

    points: tuple[TimePoint, ...]
    links: tuple[ParametricLink, ...]
    vague: Mapping[str, str]

    def at(self, ends: Ends) -> Stnu:
        """The network of a box.

        Raises:
            InputError: if a contingent link may end before it starts (see :meth:`early`), or a requirement cannot be
                met because a face is infinitely far out (see :meth:`endless`).
        """
        endless = self.endless(ends)
        if endless:
            names = ", ".join(sorted({name for name, _ in endless}))
            raise InputError(f"a requirement becomes infinitely strong; expected finite ends for {names}")
        return Stnu(self.points, tuple(_concrete(link, ends) for link in self.links))

    def early(self, ends: Ends) -> Iterator[tuple[int, Form]]:
        """Contingent links that may end before they start in a box, by index, with the form that is negative.

        One whose length is fixed is no matter of uncertainty, and not among them.
        """
        for index, link in enumerate(self.links):
            if link.is_contingent and link.lower is not None:
                low, high = value(least(link.lower), ends), value(greatest(link.lower), ends)
                if low < NOTHING and low != high:
                    yield index, least(link.lower)

    def endless(self, ends: Ends) -> frozenset[Face]:
        """Faces that are infinitely far out and make a bound of a requirement infinitely strong: none may be."""
        found: set[Face] = set()
        for link in self.links:
            if not link.is_contingent:
                forms = [link.form(way) for way in link.ways]
                found.update(face for form in forms for face, _ in form.coefficients() if ends[face] is None)
        return frozenset(found)

    def form(self, step: Step) -> Form:
        """The weight of an edge of the distance graph, over the ends of a box."""
        return self.links[step.link].form(step.way)


def _concrete(link: ParametricLink, ends: Ends) -> Link:
    if not link.is_contingent:
        lower = None if link.lower is None else finite_value(greatest(link.lower), ends)
        upper = None if link.upper is None else finite_value(least(link.upper), ends)
        return RequirementLink(link.source, link.target, lower, upper, link.origin)
    length = link.lower or _NOTHING
    low, high = finite_value(least(length), ends), finite_value(greatest(length), ends)
    if low is not None and low == high and low < 0:
        return RequirementLink(link.source, link.target, low, low, link.origin)
    if low is None:
        raise InputError(f"contingent link {link.origin} has no least length; expected one of at least 0")
    return ContingentLink(link.source, link.target, low, high, str(length), link.origin)


# -- from a plan -----------------------------------------------------------------------------------------------------


def parametric_stnu(plan: ParametrizedPlan, box: Box) -> ParametricStnu:
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
        *(ParametricLink(ZERO, p, _NOTHING, None, False, f"{p} ≥ 0") for p in plan.time_points[1:]),
    ]
    return ParametricStnu(plan.time_points, tuple(links), _vague(links, box))


def _bounds(plan: ParametrizedPlan) -> Iterator[ParametricLink]:
    """Every bound of the network; a lower and an upper bound that are equal make one link."""
    for point in plan.time_points:
        if point.kind is TimePointKind.TIMED_LITERAL:
            time: Length = Polynomial.constant(point.time or Fraction(0))
            yield ParametricLink(ZERO, point, time, time, False, f"timed initial literal {point}")
    for item in plan.constraints:
        lower = None if item.lower is None else _length(item.lower)
        upper = None if item.upper is None else _length(item.upper)
        yield ParametricLink(item.source, item.target, lower, upper, False, describe(item))


def _length(bound: Bound) -> Length:
    if not bound.is_linear:
        raise UnsupportedError(f"the bound {bound} of a temporal constraint is not linear in the parameters")
    terms: dict[tuple[str, ...], Fraction] = {(): bound.constant_term}
    for name, factor in bound.coefficients():
        if not isinstance(name, ParameterReference):
            raise TypeError(f"a temporal constraint can only mention parameters, not {name}")
        terms[name.name,] = factor
    return Polynomial(terms)


def _contingent(plan: ParametrizedPlan, fixed: Iterable[ParametricLink], box: Box) -> dict[int, ParametricLink]:
    """Which of the links that fix a distance are contingent, by identity: at most one into each time point, no circles.

    Durations of instances come first, also constant ones: the end of an action comes by itself.
    """
    duration = {(one.start, one.end) for one in plan.instances if one.durative}
    chosen: dict[int, ParametricLink] = {}
    before: dict[TimePoint, TimePoint] = {}
    oriented = [(id(one), _oriented(one, duration, box)) for one in fixed]
    oriented.sort(key=lambda pair: (pair[1].source, pair[1].target) not in duration)
    for key, link in oriented:
        is_duration = (link.source, link.target) in duration
        varies = link.lower is not None and not link.lower.is_constant
        free = link.target.kind not in {TimePointKind.ZERO, TimePointKind.TIMED_LITERAL}
        if (is_duration or varies) and free and link.target not in before and not _follows(link, before):
            before[link.target] = link.source
            chosen[key] = link
    return chosen


def _oriented(link: ParametricLink, duration: set[tuple[TimePoint, TimePoint]], box: Box) -> ParametricLink:
    """The link as a contingent one: from what happens first."""
    length = link.lower or _NOTHING
    turned = (link.target, link.source) in duration
    if (link.source, link.target) not in duration and not turned:
        turned = value(greatest(length), ends_of(box)) <= NOTHING
    if turned:
        return ParametricLink(link.target, link.source, -length, -length, True, link.origin)
    return ParametricLink(link.source, link.target, length, length, True, link.origin)


def _follows(link: ParametricLink, before: Mapping[TimePoint, TimePoint]) -> bool:
    """Whether the link's source happens because of its target."""
    point = link.source
    while point != link.target and point in before:
        point = before[point]
    return point == link.target


def _vague(links: Iterable[ParametricLink], box: Box) -> dict[str, str]:
    lengths: Counter[str] = Counter()
    bounds: Counter[str] = Counter()
    for link in links:
        if link.is_contingent:
            lengths.update(link.lower.variables if link.lower is not None else ())
        else:
            for bound in {link.lower, link.upper} - {None}:
                bounds.update(bound.variables if bound is not None else ())
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
class Difference:
    """`t_target − t_source ≥ form` between time points that the dispatcher executes; `origin` is the requirement."""

    source: TimePoint
    target: TimePoint
    form: Form
    origin: str


@dataclass(frozen=True)
class StrongAnswer:
    """A schedule of the dispatcher's time points, or a cycle of differences whose sum is positive.

    `endless` are faces that are infinitely far out although a difference grows with them: each may be at any finite
    place as far as that difference is concerned, but not infinitely far out.
    """

    schedule: Mapping[TimePoint, Fraction] | None
    cycle: tuple[Difference, ...]
    endless: frozenset[Face]

    @property
    def is_controllable(self) -> bool:
        return self.schedule is not None


def differences(network: ParametricStnu) -> tuple[Difference, ...]:
    """The requirements with the worst lengths of contingent links, for every box."""
    base = {point: (point, Polynomial[str]({})) for point in network.points}
    into = {link.target: link for link in network.links if link.is_contingent}

    def place(point: TimePoint) -> tuple[TimePoint, Length]:
        offset = Polynomial[str]({})
        while point in into:
            link = into[point]
            offset = offset + (link.lower or 0)
            point = link.source
        return point, offset

    base = {point: place(point) for point in network.points}
    found: dict[tuple[TimePoint, TimePoint, Form], Difference] = {}
    for link in network.links:
        if not link.is_contingent:
            (a, before), (b, after) = base[link.source], base[link.target]
            if link.lower is not None:
                form = greatest(link.lower + before - after)
                found.setdefault((a, b, form), Difference(a, b, form, link.origin))
            if link.upper is not None:
                form = greatest(after - before - link.upper)
                found.setdefault((b, a, form), Difference(b, a, form, link.origin))
    return tuple(found.values())


def strong(network: ParametricStnu, ends: Ends) -> StrongAnswer:
    """Whether one schedule suits all parameter values in a box with these ends."""
    return solve(network.points, differences(network), ends)


def solve(points: Iterable[TimePoint], needed: Iterable[Difference], ends: Ends) -> StrongAnswer:
    """The earliest schedule that satisfies the differences, or why there is none."""
    needed = tuple(needed)
    endless = frozenset(_endless(needed, ends))
    if endless:
        first = next(one for one in needed if any(face in endless for face, _ in one.form.coefficients()))
        return StrongAnswer(None, (first,), endless)
    weighted = [(one, finite_value(one.form, ends) or Fraction(0)) for one in needed]
    times = dict.fromkeys((point for one in needed for point in (one.source, one.target)), Fraction(0))
    why: dict[TimePoint, Difference] = {}
    for _ in range(len(times) + 1):
        late = None
        for one, weight in weighted:
            if times[one.source] + weight > times[one.target]:
                times[one.target] = times[one.source] + weight
                why[one.target] = one
                late = one.target
        if late is None:
            origin = times[next(iter(points))]
            return StrongAnswer({point: time - origin for point, time in times.items()}, (), frozenset())
    return StrongAnswer(None, _cycle(why, late), frozenset()) if late is not None else StrongAnswer({}, (), frozenset())


def _endless(needed: Iterable[Difference], ends: Ends) -> Iterator[Face]:
    for one in needed:
        for face, _ in one.form.coefficients():
            if ends[face] is None:
                yield face


def _cycle(why: Mapping[TimePoint, Difference], late: TimePoint) -> tuple[Difference, ...]:
    """The cycle of last causes behind a time point that never settles."""
    seen: list[TimePoint] = []
    point = late
    while point not in seen:
        seen.append(point)
        point = why[point].source
    members = seen[seen.index(point) :]
    return tuple(why[member] for member in reversed(members))
