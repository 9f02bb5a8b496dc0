"""What of a plan may be changed to repair it, and the plan in which all of that is a parameter.

A bound of the network that is a number, or infinite, may become another number; the nominal value of a parameter may
move within its declared bounds. Bounds that no repair needs are left out: a duration that the domain fixes without
regard to the state is what it is in every schedule of a valid plan, and no time point is before zero, so a bound that
goes beyond such a limit says no more than one that is at it.

A repair says how long, not what comes first: where a bound orders two time points, its new value does as well, and if
they are at least ε apart they stay so, unless reordering is allowed.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction

from robust.encode import network
from robust.errors import Location
from robust.numbers import format_number, readable
from robust.plan import model
from robust.plan.model import Bound, ParametrizedPlan, TemporalConstraint, TimePoint
from robust.plan.polynomial import Polynomial
from robust.qe.box import Side


class Changeable(Enum):
    """What may be changed."""

    BOUND = "bound"
    NOMINAL = "nominal"


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of the plan that may be changed.

    `name` is that of the parameter which stands for it: no parameter of a plan has blanks in its name. `old` is None
    for an infinite bound. A unit of change costs `weight`. Other values than those from `lower` to `upper` are not
    allowed, or never needed. Of a bound, `constraint` is its number in the plan and `side` which one it is.
    """

    name: str
    kind: Changeable
    old: Fraction | None
    weight: Fraction = Fraction(1)
    lower: Fraction | None = None
    upper: Fraction | None = None
    constraint: int = -1
    side: Side = Side.UPPER


class Unchanged(dict[str, Fraction]):
    """Values, where what is not among them is what it was."""

    def __init__(self, known: Mapping[str, Quantity], values: Mapping[str, Fraction]) -> None:
        super().__init__(values)
        self._known = known

    def __missing__(self, name: str) -> Fraction:
        return self._known[name].old or Fraction(0)


def bound_name(constraint: int, side: Side) -> str:
    """The name of a bound."""
    return f"{side.value} bound of constraint {constraint}"


Limits = tuple[Fraction | None, Fraction | None]


def quantities(
    plan: ParametrizedPlan, kinds: Collection[Changeable], fixed: Collection[str] = (), gap: Fraction | None = None
) -> list[Quantity]:
    """All that may be changed.

    Args:
        plan: the plan.
        kinds: what may be changed.
        fixed: parameters that keep their nominal values.
        gap: what is left at least of a bound that orders two time points; None: it may order them the other way.
    """
    listed = list(_bounds(plan, gap)) if Changeable.BOUND in kinds else []
    if Changeable.NOMINAL in kinds:
        for parameter in plan.parameters:
            if parameter.name not in fixed:
                numbers = parameter.nominal, parameter.weight, parameter.lower, parameter.upper
                listed.append(Quantity(parameter.name, Changeable.NOMINAL, *numbers))
    return listed


def _bounds(plan: ParametrizedPlan, gap: Fraction | None) -> Iterator[Quantity]:
    limits = _limits(plan)
    for number, constraint in enumerate(plan.constraints):
        least, greatest = limits.get((constraint.source, constraint.target), (None, None))
        for side in Side:
            bound = _bound_of(constraint, side)
            if bound is not None and not bound.is_constant:
                continue
            old = None if bound is None else bound.constant_term
            lower, upper = least, greatest
            if old is None:
                # Infinite is beyond all limits.
                lower, upper = (None, upper) if side is Side.LOWER else (lower, None)
            else:
                lower = None if lower is None else min(lower, old)
                upper = None if upper is None else max(upper, old)
            if gap is not None and old is not None and old * side.sign <= 0:
                kept = min(abs(old), gap)
                if side is Side.LOWER:
                    lower = kept if lower is None else max(lower, kept)
                else:
                    upper = -kept if upper is None else min(upper, -kept)
            if lower is None or lower != upper:
                yield Quantity(bound_name(number, side), Changeable.BOUND, old, Fraction(1), lower, upper, number, side)


def _limits(plan: ParametrizedPlan) -> dict[tuple[TimePoint, TimePoint], Limits]:
    """How far apart two time points can be in any schedule of a valid plan, by what the domain says of durations."""
    limits: dict[tuple[TimePoint, TimePoint], Limits] = {}

    def add(source: TimePoint, target: TimePoint, least: Fraction) -> None:
        low, high = limits.get((source, target), (None, None))
        low = least if low is None else max(low, least)
        limits[source, target] = low, high
        limits[target, source] = None if high is None else -high, -low

    for point in plan.time_points[1:]:
        add(model.ZERO, point, Fraction(0))
    for rule in network.duration_rules(plan, network.Writes(plan)):
        for bound in rule.bounds:
            if bound.weight.is_constant:
                add(bound.source, bound.target, bound.weight.constant_term)
    return limits


def _bound_of(constraint: TemporalConstraint, side: Side) -> Bound | None:
    return constraint.upper if side is Side.UPPER else constraint.lower


def _with_bound(constraint: TemporalConstraint, side: Side, bound: Bound) -> TemporalConstraint:
    return replace(constraint, upper=bound) if side is Side.UPPER else replace(constraint, lower=bound)


def lifted(plan: ParametrizedPlan, changeable: Sequence[Quantity]) -> ParametrizedPlan:
    """The plan with a parameter for each bound that may be changed."""
    constraints, parameters = list(plan.constraints), list(plan.parameters)
    for quantity in changeable:
        if quantity.kind is Changeable.BOUND:
            reference: Bound = Polynomial.variable(model.ParameterReference(quantity.name))
            constraints[quantity.constraint] = _with_bound(constraints[quantity.constraint], quantity.side, reference)
            numbers = quantity.old or Fraction(0), quantity.weight, quantity.lower, quantity.upper
            parameters.append(model.Parameter(quantity.name, *numbers))
    return replace(plan, constraints=tuple(constraints), parameters=tuple(parameters))


def changed(plan: ParametrizedPlan, changeable: Sequence[Quantity], values: Mapping[str, Fraction]) -> ParametrizedPlan:
    """The plan with other values for some quantities, by their names."""
    constraints = list(plan.constraints)
    parameters = {parameter.name: parameter for parameter in plan.parameters}
    for quantity in changeable:
        if quantity.name not in values:
            continue
        value = values[quantity.name]
        if quantity.kind is Changeable.BOUND:
            moved: Bound = Polynomial.constant(value)
            constraints[quantity.constraint] = _with_bound(constraints[quantity.constraint], quantity.side, moved)
        else:
            parameters[quantity.name] = replace(parameters[quantity.name], nominal=value)
    return replace(plan, constraints=tuple(constraints), parameters=tuple(parameters.values()))


@dataclass(frozen=True, slots=True)
class QuantityChange:
    """One number of the plan and what becomes of it; `serves` are the obligations that break without the change.

    `statement` is the one that is changed, as it was written, at `location`; `words` say the change to people.
    """

    quantity: Quantity
    new: Fraction
    statement: str
    location: Location | None
    words: str
    serves: tuple[str, ...]

    @property
    def old(self) -> Fraction | None:
        """None if it was infinite."""
        return self.quantity.old

    @property
    def cost(self) -> Fraction | None:
        """The amount times the weight; None for a bound that was infinite."""
        return None if self.old is None else abs(self.new - self.old) * self.quantity.weight

    @property
    def part(self) -> str:
        """Which number of the statement, as the language of plans calls it: `lower`, `upper` or `default`."""
        return "default" if self.quantity.kind is Changeable.NOMINAL else self.quantity.side.value

    def __str__(self) -> str:
        infinite = "-inf" if self.quantity.side is Side.LOWER else "inf"
        old = infinite if self.old is None else format_number(self.old)
        what = "nominal value" if self.quantity.kind is Changeable.NOMINAL else f"{self.quantity.side.value} bound"
        return f"{self.statement}: {what} {old} to {format_number(self.new)}"


def change_of(plan: ParametrizedPlan, quantity: Quantity, new: Fraction, serves: tuple[str, ...]) -> QuantityChange:
    """What becomes of a quantity of the plan."""
    if quantity.kind is Changeable.NOMINAL:
        parameter = next(parameter for parameter in plan.parameters if parameter.name == quantity.name)
        words = f"{quantity.name} {readable(new)} instead of {readable(parameter.nominal)}"
        return QuantityChange(quantity, new, f"parameter {quantity.name}", parameter.location, words, serves)
    constraint = plan.constraints[quantity.constraint]
    return QuantityChange(
        quantity, new, str(constraint), constraint.location, _words(constraint, quantity, new), serves
    )


def _words(constraint: TemporalConstraint, quantity: Quantity, new: Fraction) -> str:
    """`a.start at most 16 after b.end instead of 20`."""
    old = quantity.old
    now = _bounded(constraint, quantity.side, new)
    if old is None:
        return f"{constraint.target} {now}, where there was no limit"
    if (old < 0) == (new < 0):
        return f"{constraint.target} {now} instead of {readable(abs(old))}"
    return f"{constraint.target} {now} instead of {_bounded(constraint, quantity.side, old)}"


def _bounded(constraint: TemporalConstraint, side: Side, value: Fraction) -> str:
    upper = side is Side.UPPER
    if constraint.source == model.ZERO and value >= 0:
        return f"at {readable(value)} {'at the latest' if upper else 'at the earliest'}"
    if value < 0:
        return f"{'at least' if upper else 'at most'} {readable(-value)} before {constraint.source}"
    return f"{'at most' if upper else 'at least'} {readable(value)} after {constraint.source}"


# -- what comes of a repair --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, order=True)
class Cost:
    """Fewer changes that count come first, then a smaller sum of amounts times weights."""

    count: int = 0
    total: Fraction = Fraction(0)
