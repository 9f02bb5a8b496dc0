"""The least change of bounds after which a network is dynamically controllable; exact, and at any time with its gap.

Requirements are relaxed, a lower bound down or an upper bound up; contingent links are tightened, a lower bound up or
an upper bound down. Each unit of a change costs the weight of its link.

The search follows conflicts (Yu, Fang and Williams, 2014: *Resolving uncontrollable conditional temporal problems
using continuous relaxations*). A semi-reducible negative cycle shows that a network is not controllable as long as the
whole walk and the pieces after its lower-case edges are negative; each length is linear in the changes, so in every
repair one of them is at least 0: a clause for :mod:`robust.irr.conflicts`, which finds the cheapest changes.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf
from typing import Any

from robust import errors, searching
from robust.encode.interface import variable
from robust.irr.conflicts import Candidate, Chosen, Clause, Point, RepairSearching, RepairStatus
from robust.network.uncertain import EdgeStep, NegativeCycle, Way, dynamic, explain
from robust.numbers import Number, exact, format_number
from robust.plan.model import ParameterReference
from robust.plan.polynomial import Polynomial
from robust.presented import Presented
from robust.qe import constraint, simplex
from robust.qe.box import Side
from robust.smt import limits, terms
from robust.stnu.files import Source, deadline, network_of
from robust.stnu.network import Link, Network, Role

_NOTHING = Fraction(0)
Bound = tuple[int, Side]
"""A bound of a link, by its number."""
Form = Mapping[Bound, int]
"""A length as a sum of multiples of bounds."""


@dataclass(frozen=True, slots=True)
class LinkChange:
    """One bound of a link moves by `amount`; `serves` are the conflicts that make it necessary, in words."""

    link: Link
    side: Side
    new: Fraction
    amount: Fraction
    cost: Fraction
    serves: tuple[str, ...]

    @property
    def old(self) -> Fraction:
        return self.link.bound(self.side) or _NOTHING

    def __str__(self) -> str:
        return f"{self.link.ends}: {self.side.value} bound {format_number(self.old)} to {format_number(self.new)}"


@dataclass(frozen=True)
class NetworkRepair(Presented, ask="status"):
    """The result of a search: `network` is the repaired one, None if there is none; no repair costs less than `bound`.

    `conflicts` and `candidates` are how many were met and examined; `name` is that of the network.
    """

    status: RepairStatus
    network: Network | None
    changes: tuple[LinkChange, ...]
    bound: Fraction
    conflicts: int
    candidates: int
    seconds: float
    interrupted: bool = False
    name: str = ""

    @property
    def cost(self) -> Fraction | None:
        return None if self.network is None else sum((change.cost for change in self.changes), _NOTHING)

    @property
    def gap(self) -> Fraction | None:
        """The greatest possible saving of another repair."""
        return None if self.cost is None else self.cost - self.bound

    @property
    def cut_short(self) -> bool:
        return self.status.is_open


def repair(
    network: Source,
    *,
    requirement: Number | None = 1,
    contingent: Number | None = 1,
    weights: Mapping[tuple[str, str], Number | None] | None = None,
    timeout: Number | None = None,
) -> NetworkRepair:
    """The cheapest repair of a network.

    Args:
        network: a network, or the path of one.
        requirement: what a unit of change costs of each requirement, above 0; None: they stay as they are.
        contingent: what a unit of change costs of each contingent link.
        weights: what it costs of links between two time points, by the names of both.
        timeout: seconds after which the best repair so far is returned.

    Raises:
        InputError: if there is anything wrong in the file, a weight is not above 0, or of a link that there is not.
    """
    whole = network_of(network)
    single = {ends: _weight(weight, "weights") for ends, weight in (weights or {}).items()}
    unknown = single.keys() - {(link.source, link.target) for link in whole.links}
    if unknown:
        raise errors.InputError(
            f"found no link {min(unknown)}, expected one of the network", errors.Location("weights")
        )
    every = _weight(requirement, "requirement"), _weight(contingent, "contingent")
    return NetworkRepairSearch(whole, *every, single, deadline(timeout)).run()


def _weight(value: Number | None, name: str) -> Fraction | None:
    """A weight; None is infinite."""
    if value is None:
        return None
    weight = exact(value, errors.Location(name))
    if weight <= 0:
        raise errors.InputError(f"found {weight}, expected a number above 0", errors.Location(name))
    return weight


class NetworkRepairSearch(RepairSearching[Fraction, NetworkRepair]):
    """One search for the least change of a network; a point has the change of each bound."""

    def __init__(
        self,
        network: Network,
        requirement: Fraction | None,
        contingent: Fraction | None,
        weights: Mapping[tuple[str, str], Fraction | None],
        deadline: limits.Deadline,
    ) -> None:
        super().__init__(solver="z3", deadline=deadline, lowest=_NOTHING)
        self._network = network
        self._weight: dict[str, Fraction] = {}
        self._bound_of: dict[str, Bound] = {}
        for number, link in enumerate(network.links):
            weight = weights.get((link.source, link.target), contingent if link.is_contingent else requirement)
            for side in Side:
                if weight is not None and link.bound(side) is not None:
                    name = _name((number, side))
                    self._weight[name], self._bound_of[name] = weight, (number, side)

    # -- the search ----------------------------------------------------------------------------------------------------

    def symbols(self) -> list[str]:
        return sorted({n for clause in self.clauses for choice in clause.choices for n in choice.parameters})

    def always(self) -> Iterator[constraint.LinearConstraint]:
        return self._limits(self.symbols())

    def holds(self, choice: constraint.LinearConstraint, point: Point) -> bool:
        return choice.evaluate(_Zeros(point))

    def cheaper(self, cost: Fraction) -> terms.Formula:
        price = (variable(ParameterReference(name)).scaled(self._weight[name]) for name in self.symbols())
        return self.terms.greater(Polynomial.constant(cost) - sum(price, Polynomial({})))

    def cheapest(self, chosen: Chosen, _point: Point) -> Candidate[Fraction] | None:
        """The cheapest changes that satisfy inequalities and leave contingent links some length; None if none do."""
        names = sorted({name for choice in chosen.values() for name in choice.parameters})
        constraints = [*chosen.values(), *self._limits(names)]
        best = simplex.maximize(names, constraints, {name: -self._weight[name] for name in names})
        if best is None or best.value is None:
            return None
        return Candidate(chosen, {name: value for name, value in best.point.items() if value}, -best.value)

    def accept(self, candidate: Candidate[Fraction]) -> None:
        """Keep the best repair so far, or a cheaper one under its inequalities."""
        self.best = candidate
        if candidate.cost == self.lowest:
            return
        polished = self.cheapest(candidate.chosen, candidate.point)
        if polished is not None and polished.cost < candidate.cost and self.violated(polished) is None:
            self.best = polished

    def step(self, candidate: Candidate[Fraction], number: int) -> Candidate[Fraction] | None:
        """A candidate with one more change of one bound, which resolves the conflict."""
        best: tuple[Fraction, bool] | None = None
        cheapest: Candidate[Fraction] | None = None
        for choice in self.clauses[number].choices:
            missing = choice.value(_Zeros(candidate.point)) - choice.constant
            for name, factor in choice.coefficients:
                amount = missing / -factor
                # Of equal costs, a requirement is easier to change than nature.
                rank = amount * self._weight[name], self._link(name).is_contingent
                if factor < 0 and amount <= self._room(name, candidate.point) and (best is None or rank < best):
                    best = rank
                    point = {**candidate.point, name: candidate.point.get(name, _NOTHING) + amount}
                    cheapest = Candidate({**candidate.chosen, number: choice}, point, candidate.cost + rank[0])
        return cheapest

    def _link(self, name: str) -> Link:
        return self._network.links[self._bound_of[name][0]]

    def _room(self, name: str, point: Point) -> Fraction | float:
        """The distance that a bound may still move: a contingent link keeps a length."""
        number, link = self._bound_of[name][0], self._link(name)
        if not link.is_contingent or link.lower is None or link.upper is None:
            return inf
        taken = (point.get(_name((number, side)), _NOTHING) for side in Side)
        return link.upper - link.lower - sum(taken, _NOTHING)

    def conflict_at(self, candidate: Candidate[Fraction]) -> Clause | None:
        """The conflict in the changed network; None if it is controllable."""
        network = self._changed(candidate.point)
        answer = dynamic(network.examined.stnu, self.deadline)
        if answer.cycle is None:
            return None
        choices = tuple(dict.fromkeys(self._choices(network, answer.cycle)))
        return Clause(choices, explain(network.examined.stnu, answer.cycle))

    def _choices(self, network: Network, cycle: NegativeCycle) -> Iterator[constraint.LinearConstraint]:
        """For each negative piece that changes can help, that it is at least 0.

        It may be these changes that made the piece negative; then fewer of them help.
        """
        for piece in cycle.pieces:
            if any(_is_endless(network, step) for step in piece):
                continue
            form: Counter[Bound] = Counter()
            for step in piece:
                for bound, factor in _form(network, step).items():
                    form[bound] += factor
            length, coefficients = _NOTHING, {}
            for (number, side), factor in form.items():
                length += factor * (self._network.links[number].bound(side) or 0)
                name = _name((number, side))
                if factor and name in self._weight:
                    coefficients[name] = factor * _direction(self._network.links[number], side)
            if length >= 0 or any(factor > 0 for factor in coefficients.values()):
                yield constraint.LinearConstraint.of(coefficients, ">=", -length)

    def _limits(self, names: Sequence[str]) -> Iterator[constraint.LinearConstraint]:
        """Changes go one way, and leave contingent links some length."""
        for name in names:
            yield constraint.LinearConstraint.of({name: 1}, ">=", 0)
            number, _ = self._bound_of[name]
            link = self._network.links[number]
            if link.is_contingent and link.lower is not None and link.upper is not None:
                both = {_name((number, side)): 1 for side in Side if _name((number, side)) in names}
                yield constraint.LinearConstraint.of(both, "<=", link.upper - link.lower)

    # -- results -------------------------------------------------------------------------------------------------------

    def _changed(self, point: Point) -> Network:
        links = list(self._network.links)
        for name, amount in point.items():
            number, side = self._bound_of[name]
            moved = (links[number].bound(side) or 0) + _direction(links[number], side) * amount
            bounds: dict[str, Any] = {side.value: moved}
            links[number] = replace(links[number], **bounds)
        return self._network.with_links(links)

    def _result(self, status: searching.Status, reason: str | None = None) -> NetworkRepair:
        return NetworkRepair(
            self.repaired(status),
            None if self.best is None else self._changed(self.best.point),
            () if self.best is None else tuple(self._changes(self.best)),
            self.lowest or _NOTHING,
            len(self.clauses),
            self.examined,
            self._seconds(),
            status is searching.Status.INTERRUPTED,
            self._network.name,
        )

    def _changes(self, repair: Candidate[Fraction]) -> Iterator[LinkChange]:
        for name, amount in sorted(repair.point.items(), key=lambda item: self._bound_of[item[0]][0]):
            link, side = self._link(name), self._bound_of[name][1]
            chosen = repair.chosen.items()
            serves = dict.fromkeys(self.clauses[known].reason for known, choice in chosen if name in choice.parameters)
            new = (link.bound(side) or _NOTHING) + _direction(link, side) * amount
            yield LinkChange(link, side, new, amount, amount * self._weight[name], tuple(serves))


class _Zeros(dict[str, Fraction]):
    """Changes that are not mentioned are none."""

    def __missing__(self, _name: str) -> Fraction:
        return _NOTHING


def _name(bound: Bound) -> str:
    return f"{bound[0]}.{bound[1].value}"


def _direction(link: Link, side: Side) -> int:
    """Which way a bound may move."""
    return 1 if (side is Side.UPPER) != link.is_contingent else -1


def _is_endless(network: Network, step: EdgeStep) -> bool:
    """Whether an edge is infinitely negative, whatever is changed."""
    return step.way is Way.LONGEST and network.examined.stnu.links[step.link].upper is None


def _form(network: Network, step: EdgeStep) -> Form:
    """The length of an edge in terms of the bounds of the network's links."""
    role, number = network.examined.roles[step.link]
    lower, upper = (number, Side.LOWER), (number, Side.UPPER)
    sign = 1 if step.way.is_forwards else -1
    at_upper = step.way in {Way.AT_MOST, Way.LONGEST}
    match role:
        case Role.IMPLICIT:
            return {}
        case Role.SETTLED:
            return {lower: -sign}
        case Role.SPAN:
            return {upper: sign, lower: -sign} if at_upper else {}
        case Role.WHOLE:
            return {upper if at_upper else lower: sign}
