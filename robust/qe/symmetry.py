"""Parameters that may be exchanged, with what belongs to them, without changing the plan; and what that saves.

An exchange maps parameters, instances, atoms and fluents to others of their kind. It is a symmetry if the plan's facts
about the images are the plan's facts again: bounds of parameters, the network, conditions, effects, the initial state,
timed literals and the goal. What they are called, nominal values and weights do not decide which parameter values are
good, and do not count. Candidates come from refining colours [Weisfeiler and Leman 1968]; what counts is the comparison
of all facts at the end, so an exchange that is not found costs time, never soundness.

The envelope is invariant under symmetries. If all permutations of some parameters are among them, it is known once it
is known where those are in ascending order.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise, starmap
from typing import Any, TypeVar

from robust.plan import model
from robust.qe.conjunctions import Conjunction
from robust.qe.constraint import Coefficients, LinearConstraint
from robust.smt.limits import NEVER, Deadline

Number = TypeVar("Number", int, Fraction)
Swap = tuple[tuple[str, str], ...]
"""Pairs of parameters that change places together."""


@dataclass(frozen=True)
class Symmetry:
    """Exchanges that leave the envelope what it is.

    Each class lists a parameter and those that it may change places with: `swaps` has an exchange for each of those,
    which leaves the others of its class, and those of the classes before, where they are. So every point has an image
    in which every class ascends.
    """

    classes: tuple[tuple[str, ...], ...] = ()
    swaps: tuple[tuple[Swap, ...], ...] = ()

    def __bool__(self) -> bool:
        return bool(self.classes)

    def within(self, parameters: Iterable[str]) -> Symmetry:
        """The classes whose exchanges keep to a group of parameters that no exchange leaves."""
        group = set(parameters)
        chosen = [
            (names, swaps)
            for names, swaps in zip(self.classes, self.swaps, strict=True)
            if all(name in group for swap in swaps for pair in swap for name in pair)
        ]
        return Symmetry(tuple(names for names, _ in chosen), tuple(swaps for _, swaps in chosen))

    @property
    def ascending(self) -> Conjunction:
        """Every class in ascending order."""
        return tuple(
            LinearConstraint.of({low: 1, high: -1}, "<=", 0) for names in self.classes for low, high in pairwise(names)
        )

    def sorted(self, point: Mapping[str, Number]) -> dict[str, Number]:
        """An image of the point in which every class ascends."""
        values = dict(point)
        for names, swaps in zip(self.classes, self.swaps, strict=True):
            for place in range(len(names) - 1):
                least = min(range(place, len(names)), key=lambda index: (values[names[index]], index))
                for swap in _transposition(swaps, place, least):
                    values = _swapped(values, swap)
        return values

    def orbit(self, name: str) -> set[str]:
        """The parameters that exchanges take one to, itself among them."""
        orbit, pending = {name}, [name]
        while pending:
            current = pending.pop()
            images = {exchange.get(current, current) for exchange in self._exchanges} - orbit
            orbit |= images
            pending += images
        return orbit

    def images(self, piece: Conjunction, most: int) -> list[Conjunction] | None:
        """The images of the piece under all permutations, each once; None if there are more than `most`."""
        start = frozenset((side.coefficients, side.relation, side.constant) for side in piece)
        images, pending = {start}, [start]
        while pending:
            current = pending.pop()
            for exchange in self._exchanges:
                image = frozenset((_renamed(form, exchange), sense, end) for form, sense, end in current)
                if image not in images:
                    if len(images) == most:
                        return None
                    images.add(image)
                    pending.append(image)
        constraints = {tuple(sorted(starmap(LinearConstraint, image), key=str)) for image in images}
        return sorted(constraints, key=str)

    @cached_property
    def _exchanges(self) -> list[dict[str, str]]:
        return [_both_ways(swap) for swaps in self.swaps for swap in swaps]


def _transposition(swaps: Sequence[Swap], left: int, right: int) -> Iterator[Swap]:
    """What to swap one after another so that two members of a class change places; swaps are with the first member."""
    if left == right:
        return
    if left:
        yield swaps[left - 1]
    yield swaps[right - 1]
    if left:
        yield swaps[left - 1]


def _both_ways(swap: Swap) -> dict[str, str]:
    return {**dict(swap), **{right: left for left, right in swap}}


def _swapped(values: Mapping[str, Number], swap: Swap) -> dict[str, Number]:
    exchange = _both_ways(swap)
    return {name: values[exchange.get(name, name)] for name in values}


def _renamed(form: Coefficients, exchange: Mapping[str, str]) -> Coefficients:
    return tuple(sorted((exchange.get(name, name), factor) for name, factor in form))


# -- finding them ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Symbol:
    """Something that an exchange may map to another of its kind."""

    kind: str
    identity: Hashable


class _Bag(tuple[Any, ...]):
    """Facts whose order does not matter."""

    __slots__ = ()


Fact = Any
"""A symbol, a tuple or bag of facts, or what no exchange changes."""
Naming = Callable[[_Symbol], Hashable]


def find_symmetry(plan: model.ParametrizedPlan, deadline: Deadline = NEVER) -> Symmetry:
    """Classes of parameters that may be permuted.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    bounds = Counter((parameter.lower, parameter.upper) for parameter in plan.parameters)
    if max(bounds.values(), default=0) < 2:
        return Symmetry()
    facts = _Facts(plan, deadline)
    classes: list[tuple[str, ...]] = []
    swaps: list[tuple[Swap, ...]] = []
    fixed: set[str] = set()
    for names in facts.alike():
        members: list[str] = []
        exchanges: list[Swap] = []
        for name in names:
            if name in fixed:
                continue
            if not members:
                members = [name]
                continue
            swap = facts.swap(members[0], name)
            if swap is None:
                continue
            moved = {item for pair in swap for item in pair}
            elsewhere = {item for other in exchanges for pair in other for item in pair} | set(members[1:])
            if not moved & (fixed | set(members[1:])) and name not in elsewhere:
                members.append(name)
                exchanges.append(swap)
        if exchanges:
            classes.append(tuple(members))
            swaps.append(tuple(exchanges))
            fixed.update(members)
    return Symmetry(tuple(classes), tuple(swaps))


class _Facts:
    """A plan as facts about symbols."""

    def __init__(self, plan: model.ParametrizedPlan, deadline: Deadline) -> None:
        self._deadline = deadline
        self._parameters = [_parameter(parameter.name) for parameter in plan.parameters]
        self._facts: list[Fact] = list(_facts(plan))
        self._containing: dict[_Symbol, list[Fact]] = defaultdict(list)
        for fact in self._facts:
            for symbol in dict.fromkeys(_symbols(fact)):
                self._containing[symbol].append(fact)
        self._numbers: dict[Hashable, int] = {}

    def alike(self) -> list[list[str]]:
        """Groups of several parameters that refinement does not tell apart."""
        colours = self._refined({})
        groups: dict[int, list[str]] = defaultdict(list)
        for symbol in self._parameters:
            groups[colours[symbol]].append(str(symbol.identity))
        return [names for names in groups.values() if len(names) > 1]

    def swap(self, left: str, right: str) -> Swap | None:
        """An exchange of two parameters, and of others with them, under which all facts stay what they are."""
        first, second = _parameter(left), _parameter(right)
        here = self._refined({first: "left", second: "right"})
        there = self._refined({first: "right", second: "left"})
        image = _matched(here, there)
        if image is None or not self._keeps(image):
            return None
        names = {str(symbol.identity): str(image[symbol].identity) for symbol in self._parameters}
        if any(names[names[name]] != name for name in names):
            return None
        order = {name: index for index, name in enumerate(names)}
        return tuple((name, other) for name, other in names.items() if order[name] < order[other])

    def _keeps(self, image: Mapping[_Symbol, _Symbol]) -> bool:
        """Whether the facts about the images are the facts."""
        before = Counter(_rendered(fact, lambda symbol: symbol) for fact in self._facts)
        return before == Counter(_rendered(fact, image.__getitem__) for fact in self._facts)

    def _refined(self, start: Mapping[_Symbol, str]) -> dict[_Symbol, int]:
        """Equal numbers for what facts do not tell apart, comparable among all calls."""
        colours = {symbol: self._number((symbol.kind, start.get(symbol))) for symbol in self._containing}
        while True:
            self._deadline.enforce()
            count = len(set(colours.values()))
            colours = {symbol: self._number(self._signature(symbol, colours)) for symbol in colours}
            if len(set(colours.values())) == count:
                return colours

    def _signature(self, symbol: _Symbol, colours: Mapping[_Symbol, int]) -> Hashable:
        def name(other: _Symbol) -> Hashable:
            return "this" if other == symbol else colours[other]

        return colours[symbol], _unordered(_rendered(fact, name) for fact in self._containing[symbol])

    def _number(self, signature: Hashable) -> int:
        return self._numbers.setdefault(signature, len(self._numbers))


def _matched(here: Mapping[_Symbol, int], there: Mapping[_Symbol, int]) -> dict[_Symbol, _Symbol] | None:
    """Symbols of the one to symbols of the same colour in the other, to themselves where that is possible."""
    if Counter(here.values()) != Counter(there.values()):
        return None
    free = defaultdict(list)
    for symbol, colour in there.items():
        if here[symbol] != colour:
            free[colour].append(symbol)
    return {symbol: symbol if there[symbol] == colour else free[colour].pop(0) for symbol, colour in here.items()}


def _unordered(parts: Iterable[Hashable]) -> Hashable:
    return frozenset(Counter(parts).items())


def _rendered(fact: Fact, name: Naming) -> Hashable:
    if isinstance(fact, _Symbol):
        return name(fact)
    if isinstance(fact, _Bag):
        return _unordered(_rendered(part, name) for part in fact)
    return tuple(_rendered(part, name) for part in fact) if isinstance(fact, tuple) else fact


def _symbols(fact: Fact) -> Iterator[_Symbol]:
    if isinstance(fact, _Symbol):
        yield fact
    elif isinstance(fact, tuple):
        for part in fact:
            yield from _symbols(part)


def _parameter(name: str) -> _Symbol:
    return _Symbol("parameter", name)


def _facts(plan: model.ParametrizedPlan) -> Iterator[Fact]:
    """Everything that decides whether the plan is valid. Effects of one instance, and timed literals, keep their order:
    that is that of the domain, which instances of one action share."""
    for parameter in plan.parameters:
        yield "parameter", _parameter(parameter.name), parameter.lower, parameter.upper
    for instance in plan.instances:
        symbol = _Symbol("instance", instance.identifier)
        yield "instance", symbol, instance.durative
        for duration in instance.durations:
            yield "duration", symbol, duration.timing, _condition(duration.condition)
        for condition in instance.conditions:
            yield "condition", symbol, condition.timing, _condition(condition.condition)
        yield (
            "effects",
            symbol,
            tuple((e.timing, _variable(e.atom), e.value, _condition(e.condition)) for e in instance.atom_effects),
            tuple(
                (e.timing, _variable(e.fluent), e.operator, _polynomial(e.expression), _condition(e.condition))
                for e in instance.numeric_effects
            ),
            tuple((_variable(e.fluent), _polynomial(e.rate)) for e in instance.continuous_effects),
        )
    for constraint in plan.constraints:
        ends = _point(constraint.source), _point(constraint.target)
        yield "constraint", *ends, *(b and _polynomial(b) for b in (constraint.lower, constraint.upper))
    for atom in plan.initial_atoms:
        yield "initially", _variable(atom)
    for fluent, value in plan.initial_fluents.items():
        yield "initially", _variable(fluent), _polynomial(value)
    yield "timed", tuple((literal.time, _variable(literal.target), literal.value) for literal in plan.timed_literals)
    for goal in plan.goal:
        yield "goal", _condition(goal.condition)


def _point(point: model.TimePoint) -> Fact:
    return point.kind, point.instance and _Symbol("instance", point.instance), point.time


def _variable(variable: object) -> Fact:
    match variable:
        case model.Atom():
            return _Symbol("atom", variable)
        case model.Fluent():
            return _Symbol("fluent", variable)
        case model.ParameterReference():
            return _parameter(variable.name)
    return variable


def _polynomial(expression: model.Expression) -> Fact:
    return _Bag((factor, _Bag(map(_variable, monomial))) for monomial, factor in expression.terms.items())


def _condition(condition: model.Condition) -> Fact:
    match condition:
        case model.Truth():
            return "truth", condition.value
        case model.Holds():
            return "holds", _variable(condition.atom), condition.value
        case model.NumericCondition():
            return "comparison", _polynomial(condition.expression), condition.relation
        case model.And():
            return "and", _Bag(map(_condition, condition.operands))
        case model.Or():
            return "or", _Bag(map(_condition, condition.operands))
