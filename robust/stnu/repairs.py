"""The least change of bounds after which a network is dynamically controllable; exact, and at any time with its gap.

Requirements are relaxed, a lower bound down or an upper bound up; contingent links are tightened, a lower bound up or
an upper bound down. Each unit of a change costs the weight of its link.

The search follows conflicts (Yu, Fang and Williams, 2014: *Resolving uncontrollable conditional temporal problems
using continuous relaxations*). A semi-reducible negative cycle shows that a network is not controllable as long as the
whole walk and the pieces after its lower-case edges are negative; each length is linear in the changes, so in every
repair one of them is at least 0. A solver looks for cheaper and cheaper choices of one such inequality for each
conflict, exact linear programming makes the best of each choice, and when there is no cheaper one, its cost is a lower
bound. If the network with these changes is controllable, they are optimal; else it has another conflict. Going on from
there with the cheapest inequality of one conflict after the other finds a repair early that may not be the cheapest.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf

from robust.encode.variables import variable
from robust.errors import InputError, Location
from robust.irr.quantities import RepairStatus
from robust.network.uncertain import NegativeCycle, Step, Way, dynamic, explain
from robust.numbers import Number, exact, format_number
from robust.plan.model import ParameterReference
from robust.plan.polynomial import Polynomial
from robust.presented import Presented
from robust.qe.box import Side
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.enumerate import satisfiable
from robust.qe.simplex import maximize
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session
from robust.smt.terms import Terms
from robust.stnu.files import Source, deadline, network_of
from robust.stnu.network import Link, Network, Role

_NOTHING = Fraction(0)
Bound = tuple[int, Side]
"""A bound of a link, by its number."""
Form = Mapping[Bound, int]
"""A length as a sum of multiples of bounds."""


@dataclass(frozen=True, slots=True)
class Change:
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
class Repair(Presented, ask="status"):
    """What a search found: `network` is the repaired one, None if there is none; no repair costs less than `bound`.

    `conflicts` and `candidates` are how many were met and examined; `name` is that of the network.
    """

    status: RepairStatus
    network: Network | None
    changes: tuple[Change, ...]
    bound: Fraction
    conflicts: int
    candidates: int
    seconds: float
    interrupted: bool = False
    name: str = ""

    @property
    def cost(self) -> Fraction | None:
        return None if self.network is None else sum((one.cost for one in self.changes), _NOTHING)

    @property
    def gap(self) -> Fraction | None:
        """How much cheaper a repair could be, at most."""
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
) -> Repair:
    """The cheapest repair of a network.

    Args:
        network: a network, or the path of one.
        requirement: what a unit of change costs of each requirement, above 0; None: they stay as they are.
        contingent: the same of contingent links.
        weights: the same of links between two time points, by the names of both.
        timeout: seconds after which the best repair so far is returned.

    Raises:
        InputError: if there is anything wrong in the file, a weight is not above 0, or of a link that there is not.
    """
    found = network_of(network)
    single = {ends: _weight(weight, "weights") for ends, weight in (weights or {}).items()}
    unknown = single.keys() - {(link.source, link.target) for link in found.links}
    if unknown:
        raise InputError(f"found no link {min(unknown)}, expected one of the network", Location("weights"))
    every = _weight(requirement, "requirement"), _weight(contingent, "contingent")
    search = RepairSearch(found, *every, single, deadline(timeout))
    try:
        return search.run()
    except KeyboardInterrupt:
        return search.so_far(timed_out=False)


def _weight(value: Number | None, name: str) -> Fraction | None:
    """A weight; None is infinite."""
    if value is None:
        return None
    weight = exact(value, Location(name))
    if weight <= 0:
        raise InputError(f"found {weight}, expected a number above 0", Location(name))
    return weight


@dataclass(frozen=True, slots=True)
class _Conflict:
    """One of these inequalities holds in every repair; `text` says what contradicts each other."""

    choices: tuple[LinearConstraint, ...]
    text: str


@dataclass(frozen=True, slots=True)
class _Candidate:
    """The cheapest changes under some inequalities, each of a conflict."""

    chosen: tuple[tuple[LinearConstraint, _Conflict], ...]
    point: Mapping[str, Fraction]
    cost: Fraction


class RepairSearch:
    """One search; knows at any moment what it has found."""

    def __init__(
        self,
        network: Network,
        requirement: Fraction | None,
        contingent: Fraction | None,
        weights: Mapping[tuple[str, str], Fraction | None],
        deadline: Deadline,
    ) -> None:
        self._network = network
        self._deadline = deadline
        self._started = time.perf_counter()
        self._weight: dict[str, Fraction] = {}
        self._bound_of: dict[str, Bound] = {}
        for number, link in enumerate(network.links):
            weight = weights.get((link.source, link.target), contingent if link.is_contingent else requirement)
            for side in Side:
                if weight is not None and link.bound(side) is not None:
                    name = _name((number, side))
                    self._weight[name], self._bound_of[name] = weight, (number, side)
        self._conflicts: list[_Conflict] = []
        self._examined = 0
        self._best: _Candidate | None = None
        self._lowest = _NOTHING
        self._terms = Terms()
        self._session = Session(self._terms)
        self._asserted = 0

    def run(self) -> Repair:
        """Search until the best repair is proved to be the cheapest, or time is out."""
        try:
            self._dive(_Candidate((), {}, _NOTHING))
            return self._search()
        except OutOfTimeError:
            return self.so_far(timed_out=True)

    def so_far(self, *, timed_out: bool) -> Repair:
        """The best repair that is known, and how much cheaper one could be."""
        status = RepairStatus.UNKNOWN if self._best is None else RepairStatus.FEASIBLE
        return self._result(status, interrupted=not timed_out)

    # -- the search ----------------------------------------------------------------------------------------------------

    def _search(self) -> Repair:
        while self._best is None or self._best.cost > self._lowest:
            candidate = self._cheapest_known()
            if candidate is None:
                break
            self._lowest = candidate.cost
            if self._conflict(candidate) is None:
                self._best = candidate
            else:
                self._dive(candidate)
        if self._best is None:
            return self._result(RepairStatus.IMPOSSIBLE)
        self._lowest = self._best.cost
        return self._result(RepairStatus.OPTIMAL if self._best.cost else RepairStatus.UNNEEDED)

    def _cheapest_known(self) -> _Candidate | None:
        """The cheapest changes that no known conflict forbids; None if they are no cheaper than the best repair."""
        terms, found = self._terms, None
        for conflict in self._conflicts[self._asserted :]:
            self._session.add(terms.disjunction(choice.to_formula(terms) for choice in conflict.choices))
        self._asserted = len(self._conflicts)
        names = sorted({n for known in self._conflicts for choice in known.choices for n in choice.parameters})
        price = sum((variable(ParameterReference(n)).scaled(self._weight[n]) for n in names), Polynomial({}))
        always = [constraint.to_formula(terms) for constraint in self._always(names)]
        symbols = [terms.real(ParameterReference(name)) for name in names]
        least = self._best
        while True:
            cheaper = [] if least is None else [terms.greater(Polynomial.constant(least.cost) - price)]
            with self._session.frame(*always, *cheaper):
                if not satisfiable(self._session, "cheaper changes that no known conflict forbids", self._deadline):
                    return found
                values = self._session.values(symbols)
            point = _Zeros({name: Fraction(value) for name, value in values.items()})
            chosen = ((next(c for c in one.choices if c.evaluate(point)), one) for one in self._conflicts)
            least = found = self._cheapest(tuple(chosen))

    def _dive(self, candidate: _Candidate) -> None:
        """Satisfy one conflict after the other by the cheapest change of one bound; the end is a repair, if there is
        one, and its inequalities may have a cheaper one.
        """
        while (conflict := self._conflict(candidate)) is not None:
            step = self._cheapest_step(candidate, conflict)
            if step is None or (self._best is not None and step.cost >= self._best.cost):
                return
            candidate = step
        self._best = candidate
        polished = self._cheapest(candidate.chosen)
        if polished is not None and polished.cost < candidate.cost and self._conflict(polished) is None:
            self._best = polished

    def _cheapest_step(self, candidate: _Candidate, conflict: _Conflict) -> _Candidate | None:
        """The candidate with one more change of one bound, by which the conflict is gone; None if no change does it."""
        best: tuple[Fraction, bool] | None = None
        found: _Candidate | None = None
        for choice in conflict.choices:
            missing = choice.value(_Zeros(candidate.point)) - choice.constant
            for name, factor in choice.coefficients:
                amount = missing / -factor
                # Of equal costs, a requirement is easier to change than nature.
                rank = amount * self._weight[name], self._network.links[self._bound_of[name][0]].is_contingent
                if factor < 0 and amount <= self._room(name, candidate) and (best is None or rank < best):
                    best = rank
                    point = {**candidate.point, name: candidate.point.get(name, _NOTHING) + amount}
                    found = _Candidate((*candidate.chosen, (choice, conflict)), point, candidate.cost + rank[0])
        return found

    def _room(self, name: str, candidate: _Candidate) -> Fraction | float:
        """How far a bound may move on: a contingent link keeps a length."""
        number, _ = self._bound_of[name]
        link = self._network.links[number]
        if not link.is_contingent or link.lower is None or link.upper is None:
            return inf
        taken = (candidate.point.get(_name((number, side)), _NOTHING) for side in Side)
        return link.upper - link.lower - sum(taken, _NOTHING)

    def _conflict(self, candidate: _Candidate) -> _Conflict | None:
        """A conflict that the changes leave; None if the network is controllable with them."""
        self._deadline.enforce()
        for known in self._conflicts:
            if not any(choice.evaluate(_Zeros(candidate.point)) for choice in known.choices):
                return known
        self._examined += 1
        network = self._changed(candidate.point)
        answer = dynamic(network.examined.stnu, self._deadline)
        if answer.cycle is None:
            return None
        choices = tuple(dict.fromkeys(self._choices(network, answer.cycle)))
        found = _Conflict(choices, explain(network.examined.stnu, answer.cycle))
        self._conflicts.append(found)
        return found

    def _choices(self, network: Network, cycle: NegativeCycle) -> Iterator[LinearConstraint]:
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
                yield LinearConstraint.of(coefficients, ">=", -length)

    def _cheapest(self, chosen: tuple[tuple[LinearConstraint, _Conflict], ...]) -> _Candidate | None:
        """The cheapest changes that satisfy inequalities and leave contingent links some length; None if none do."""
        names = sorted({name for choice, _ in chosen for name in choice.parameters})
        constraints = [*(choice for choice, _ in chosen), *self._always(names)]
        best = maximize(names, constraints, {name: -self._weight[name] for name in names})
        if best is None or best.value is None:
            return None
        return _Candidate(chosen, {name: value for name, value in best.point.items() if value}, -best.value)

    def _always(self, names: Sequence[str]) -> Iterator[LinearConstraint]:
        """Changes go one way, and leave contingent links some length."""
        for name in names:
            yield LinearConstraint.of({name: 1}, ">=", 0)
            number, _ = self._bound_of[name]
            link = self._network.links[number]
            if link.is_contingent and link.lower is not None and link.upper is not None:
                both = {_name((number, side)): 1 for side in Side if _name((number, side)) in names}
                yield LinearConstraint.of(both, "<=", link.upper - link.lower)

    # -- results -------------------------------------------------------------------------------------------------------

    def _changed(self, point: Mapping[str, Fraction]) -> Network:
        links = list(self._network.links)
        for name, amount in point.items():
            number, side = self._bound_of[name]
            moved = (links[number].bound(side) or 0) + _direction(links[number], side) * amount
            links[number] = (
                replace(links[number], lower=moved) if side is Side.LOWER else replace(links[number], upper=moved)
            )
        return self._network.with_links(links)

    def _result(self, status: RepairStatus, *, interrupted: bool = False) -> Repair:
        return Repair(
            status,
            None if self._best is None else self._changed(self._best.point),
            () if self._best is None else tuple(self._changes(self._best)),
            self._lowest,
            len(self._conflicts),
            self._examined,
            time.perf_counter() - self._started,
            interrupted,
            self._network.name,
        )

    def _changes(self, found: _Candidate) -> Iterator[Change]:
        for name, amount in sorted(found.point.items(), key=lambda item: self._bound_of[item[0]][0]):
            number, side = self._bound_of[name]
            link = self._network.links[number]
            serves = dict.fromkeys(conflict.text for choice, conflict in found.chosen if name in choice.parameters)
            new = (link.bound(side) or _NOTHING) + _direction(link, side) * amount
            yield Change(link, side, new, amount, amount * self._weight[name], tuple(serves))


class _Zeros(dict[str, Fraction]):
    """Changes that are not mentioned are none."""

    def __missing__(self, _name: str) -> Fraction:
        return _NOTHING


def _name(bound: Bound) -> str:
    return f"{bound[0]}.{bound[1].value}"


def _direction(link: Link, side: Side) -> int:
    """Which way a bound may move."""
    return 1 if (side is Side.UPPER) != link.is_contingent else -1


def _is_endless(network: Network, step: Step) -> bool:
    """Whether an edge is infinitely negative, whatever is changed."""
    return step.way is Way.LONGEST and network.examined.stnu.links[step.link].upper is None


def _form(network: Network, step: Step) -> Form:
    """The length of an edge in terms of the bounds of the network's links."""
    role, number = network.examined.roles[step.link]
    lower, upper = (number, Side.LOWER), (number, Side.UPPER)
    if role is Role.IMPLICIT:
        return {}
    if role is Role.SETTLED:
        return {lower: -1} if step.way.is_forwards else {lower: 1}
    match step.way:
        case Way.AT_MOST | Way.LONGEST:
            sign = 1 if step.way.is_forwards else -1
            return {upper: sign, lower: -sign} if role is Role.SPAN else {upper: sign}
        case Way.AT_LEAST | Way.SHORTEST:
            sign = 1 if step.way.is_forwards else -1
            return {} if role is Role.SPAN else {lower: sign}
