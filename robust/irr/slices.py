"""Regions where rates and times vary at once: an inner and an outer bound of the envelope, slice by slice of the rates.

In a slice, which is a box of rates, the other values that are good for all rates of the slice are exactly those that
are good at its corners (:mod:`robust.irr.rates`): the inner bound. Where all comparisons of a demand fall as a rate
rises, or all rise, whatever breaks it at the kindest corner breaks it in the whole slice: the outer bound. At a corner
the plan is linear, so that its envelope is known exactly. The envelope of the plan is between the unions of both;
slices are cut in two, the most important first, until the bounds meet or there are enough of them.

One of the first slices has the rates of the widest box, so that the inner bound holds at least that box.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial

from robust.encode import create_encoding
from robust.errors import UnsupportedError
from robust.irr.corners import CornerContainment, CornerWidening, grid_step
from robust.irr.rates import part_of, rates_of
from robust.numbers import plural
from robust.qe import estimate
from robust.qe.box import Box, Interval, Side
from robust.qe.compute import RegionResult, RegionSearch, declared_bounds
from robust.qe.inner import EnvelopeFactor
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region, absorb
from robust.qe.symmetry import Symmetry
from robust.searching import Searching, Status
from robust.smt import limits

SLICES = 16
"""Slices into which the rates are cut at most."""


@dataclass(frozen=True)
class RateSlice:
    """A box of rates, with bounds of the other values that are good for all of it, and for some of it.

    `cuts` is how often the rates were cut for it; `open` is the volume between the bounds, None if that is not finite
    or not known, and `share` its share of that of the outer bound.
    """

    rates: Box
    inner: Region
    outer: Region
    cuts: int = 0
    open: Fraction | None = None
    share: Fraction = Fraction(1)

    @staticmethod
    def between(rates: Box, inner: Region, outer: Region, cuts: int) -> RateSlice:
        """A slice with these bounds, measured."""
        if outer.is_subset_of(inner):
            return RateSlice(rates, inner, outer, cuts, Fraction(0), Fraction(0))
        size = rates.volume
        few = size is not None and len(inner.parameters) <= estimate.EXACT_DIMENSION
        volumes = (outer.volume(), inner.volume()) if few else (None, None)
        if size is None or volumes[0] is None or volumes[1] is None:
            return RateSlice(rates, inner, outer, cuts)
        between = volumes[0] - volumes[1]
        share = between / volumes[0] if volumes[0] else Fraction(1)
        return RateSlice(rates, inner, outer, cuts, size * between, share)


class EnvelopeRegion:
    """The search for the envelope of a plan; where unknowns are multiplied, for bounds of it.

    Args:
        asked: the search for the envelope of a linear plan.
        importance: see :class:`SlicedRegion`.
        most: likewise.
    """

    def __init__(
        self, asked: RegionSearch, *, importance: Callable[[RateSlice], Fraction] | None = None, most: int = SLICES
    ) -> None:
        self._asked = asked
        self._importance = importance
        self._most = most
        self.sliced: SlicedRegion | None = None

    def run(self) -> RegionResult:
        """The envelope, or bounds of it.

        Raises:
            UnsupportedError: an expression that is not linear, or one that the back end cannot handle.
            SolverError: a solver is not installed.
        """
        try:
            return self._asked.run()
        except UnsupportedError as products:
            self.sliced = SlicedRegion(self._asked, products, importance=self._importance, most=self._most)
        return self.sliced.run()

    def so_far(self, *, timed_out: bool) -> RegionResult | None:
        """What is known if the search is given up now, out of time or else interrupted."""
        return (self._asked if self.sliced is None else self.sliced).so_far(timed_out=timed_out)

    @property
    def open_share(self) -> estimate.OpenShare | None:
        """How much is open, as far as that is known."""
        return self._asked.open_share if self.sliced is None else None


class SlicedRegion(Searching[RegionResult]):
    """Bounds of the envelope of a plan in which rates multiply times that vary.

    Args:
        asked: the search that found that the plan is not linear.
        products: where.
        importance: how important it is to cut a slice; without, by the volume that it leaves open.
        most: how many slices there are at most.

    Raises:
        UnsupportedError: for a plan that corners do not decide.
    """

    def __init__(
        self,
        asked: RegionSearch,
        products: UnsupportedError,
        *,
        importance: Callable[[RateSlice], Fraction] | None = None,
        most: int = SLICES,
    ) -> None:
        super().__init__()
        self._asked = asked
        self._plan = plan = asked.plan
        self._deadline = limits.Deadline.after(asked.timeout)
        self._importance = importance
        self._most = most
        try:
            self._rates = rates_of(plan)
        except UnsupportedError as undecided:
            raise UnsupportedError(f"{products.message}; {undecided.message}", products.location) from None
        self._parameters = tuple(parameter.name for parameter in plan.parameters)
        self._others = tuple(name for name in self._parameters if name not in self._rates.names)
        self._steps = {known.name: grid_step(known) for known in plan.parameters if known.name in self._rates.names}
        self._cut = [name for name in self._rates.names if self._rates.breaking(name)]
        self._known: dict[tuple[tuple[Fraction, ...], frozenset[str]], tuple[Region, Region]] = {}
        self._slices: list[RateSlice] = [self._unknown(Box(dict(self._declared)))]
        self._box: Box | None = None
        self._pieces = 0

    @property
    def _declared(self) -> Iterator[tuple[str, Interval]]:
        return ((k.name, Interval(k.lower, k.upper)) for k in self._plan.parameters if k.name in self._rates.names)

    def _unknown(self, rates: Box) -> RateSlice:
        """A slice of which nothing is known but declared bounds."""
        bounds = [bound for bound in declared_bounds(self._plan) if set(bound.parameters) <= set(self._others)]
        universe = Region.union_of(self._others, [Polyhedron(self._others, tuple(bounds))])
        return RateSlice(rates, Region.nothing(self._others), universe)

    # -- search --------------------------------------------------------------------------------------------------------

    def _search(self) -> None:
        self._box = self._widest()
        self._slices = [self._unknown(rates) for rates in self._first()]
        self._slices.sort(key=lambda known: not (self._box and self._within_box(known.rates)))
        for number, known in enumerate(self._slices):
            self._slices[number] = self._bounded(known.rates, 0)
        while len(self._slices) < self._most:
            candidates = [known for known in self._slices if known.open != 0]
            if not candidates:
                return
            total = sum((known.open for known in candidates if known.open is not None), Fraction(0))
            chosen = max(candidates, key=partial(self._order, total=total))
            halves = [self._bounded(half, chosen.cuts + 1) for half in self._halves(chosen.rates)]
            self._slices = [known for known in self._slices if known is not chosen] + halves

    def _order(self, known: RateSlice, total: Fraction) -> Fraction:
        """How important it is to cut a slice: how much of the total it leaves open, or the less it was cut."""
        if self._importance is not None:
            return self._importance(known)
        return Fraction(1, 2**known.cuts) if known.open is None else known.open / total

    def _widest(self) -> Box | None:
        """The box that widening finds in a third of the time."""
        if not self._plan.has_nominal:
            return None
        left = self._deadline.remaining
        soon = self._deadline if left is None else limits.Deadline.after(left / 3)
        asked = self._asked
        encoding = create_encoding(asked.encoding, self._plan, asked.epsilon, soon)
        result = CornerWidening(CornerContainment(encoding, self._rates, solver=asked.solver), deadline=soon).run()
        if result.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return result.box if result.verified else None

    def _first(self) -> Iterator[Box]:
        """The declared rates, around those of the box: below and above it in one rate after the other, then itself."""
        rates = Box(dict(self._declared))
        for name in self._cut if self._box is not None else ():
            inside = self._box[name] if self._box is not None else rates[name]
            for side in Side:
                end = inside.end(side)
                if end is not None and end != rates[name].end(side):
                    yield rates.replace(name, rates[name].with_end(side.opposite, end))
            rates = rates.replace(name, Interval(inside.lower, inside.upper))
        yield rates

    def _within_box(self, rates: Box) -> bool:
        return self._box is not None and all(rates[name].is_within(self._box[name]) for name in self._cut)

    def _bounded(self, rates: Box, cuts: int) -> RateSlice:
        """Bounds of what is good in a slice."""
        limits.raise_if_interrupted()
        inner, outer = self._independent()
        for corner, demands in self._rates.corners(rates).items():
            inner = inner.intersection(self._envelope(self._rates.values(corner, demands), demands)[0])
        for corner, demands in self._rates.kindest(rates).items():
            outer = outer.intersection(self._envelope(self._rates.values(corner, demands), demands)[1])
        if not self._rates.is_decided(rates):
            inner = Region.nothing(self._others)
        inner, outer = inner.simplified(), outer.simplified()
        return RateSlice.between(rates, inner, outer, cuts)

    def _independent(self) -> tuple[Region, Region]:
        """What does not depend on rates."""
        return self._envelope({name: self._rates.usual[name] for name in self._rates.names}, frozenset())

    def _envelope(self, values: Mapping[str, Fraction], demands: frozenset[str]) -> tuple[Region, Region]:
        """An inner and an outer bound of what is good at values of rates, as to demands, or independent ones."""
        key = tuple(values.values()), demands
        if key not in self._known:
            dependent = self._rates.dependent
            counts = demands.__contains__ if demands else lambda name: name not in dependent
            plan = part_of(self._plan, values, counts)
            left = self._deadline.remaining
            asked = replace(
                self._asked, plan=plan, timeout=left, lift=False, find_box=None, on_piece=None, on_cell=None
            )
            result = asked.run()
            if result.status is Status.INTERRUPTED:
                raise KeyboardInterrupt
            self._deadline.enforce()
            self._pieces += result.pieces
            self._known[key] = result.inner(), result.region
        return self._known[key]

    def _halves(self, rates: Box) -> Iterable[Box]:
        """A slice cut in two: a rate without an end, else the one that varies most."""

        def size(name: str) -> Fraction | float:
            width = rates[name].width
            return float("inf") if width is None else width / self._steps[name]

        name = max(self._cut, key=size)
        place = self._middle(name, rates[name])
        return (rates.replace(name, rates[name].with_end(side, place)) for side in (Side.UPPER, Side.LOWER))

    def _middle(self, name: str, interval: Interval) -> Fraction:
        """Where to cut: where it is finite in the middle, on the grid if that is fine enough; else at ever more."""
        low, high, usual = interval.lower, interval.upper, self._rates.usual[name]
        if low is not None and high is not None:
            middle = (low + high) / 2
            near = self._steps[name] * round(middle / self._steps[name])
            return near if low < near < high else middle
        if usual in interval and usual not in (low, high):
            return usual
        if low is not None:
            return low + max(abs(low), abs(usual), self._steps[name])
        return (high or Fraction(0)) - max(abs(high or Fraction(0)), abs(usual), self._steps[name])

    # -- what is known -------------------------------------------------------------------------------------------------

    def _result(self, status: Status, reason: str | None = None) -> RegionResult:
        inner, outer = (self._union(which) for which in (lambda known: known.inner, lambda known: known.outer))
        if status is Status.COMPLETE and any(known.open != 0 for known in self._slices):
            names, multiply = ", ".join(self._rates.names), "multiplies" if len(self._rates.names) == 1 else "multiply"
            reason = f"{plural(len(self._slices), 'slice')} of {names}, which {multiply} times that vary"
            status = Status.UNKNOWN
        factor = EnvelopeFactor(self._parameters, Symmetry(), outer, inner)
        asked = self._asked
        return RegionResult(
            status,
            outer,
            asked.backend,
            asked.splitting,
            asked.learning,
            asked.encoding,
            asked.solver,
            self._seconds(),
            self._pieces,
            factors=(factor,),
            reason=reason,
            epsilon=asked.epsilon,
            plan=self._plan,
            box=self._box,
            open_share=None if status is Status.COMPLETE else self._open_share(outer),
            sliced=True,
        )

    def _open_share(self, outer: Region) -> estimate.OpenShare | None:
        """How much of what holds the outer bound is open."""
        extents = estimate.bounding_cell(outer.pieces) if outer.pieces else None
        volumes = [known.open for known in self._slices]
        box = None if extents is None else Box({name: Interval(low, high) for name, low, high in extents})
        if box is None or not box.volume or None in volumes:
            return None
        share = sum((volume for volume in volumes if volume is not None), Fraction(0)) / box.volume
        return estimate.OpenShare(share, share, share, box)

    def _union(self, of: Callable[[RateSlice], Region]) -> Region:
        """The union of all slices."""
        pieces = [
            Polyhedron(self._parameters, (*piece.constraints, *known.rates.constraints()))
            for known in self._slices
            for piece in of(known).as_union().pieces
        ]
        solid = [piece.simplified() for piece in pieces if not piece.is_empty]
        return Region.union_of(self._parameters, absorb(solid))
