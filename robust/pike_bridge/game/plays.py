"""Situations of a game as formulas: a correct schedule for each of finitely many, alike until a difference shows.

Without a model no strategy serves these situations: the plan is *not* controllable. A model whose choices, supports,
orders and knowledge ("e waits for choice c") do not depend on lengths is a *policy*, and a policy is one network with
uncertainty: the events of all cases, merged where nothing that the policy waits for tells the cases apart. If that is
dynamically controllable, so is the plan: branches that do not happen are simulated while the others are executed.
Otherwise a negative cycle names what the fault is due to, and lengths that break the policy.

Cases with lengths cut in two are told apart when the activity has ended, or has taken longer than the cut.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, combinations, islice, product
from typing import NamedTuple

from robust.network.uncertain import DynamicAnswer, Stnu, UncertainLink, Way, dynamic, total, weight_in
from robust.pike_bridge import model
from robust.pike_bridge.game.rules import Game, GameCase, Sign
from robust.pike_bridge.knowledge.sat import satisfiable
from robust.pike_bridge.semantics import Semantics, holds, restrict
from robust.plan.model import ZERO, TimePoint, TimePointKind
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline
from robust.smt.session import Formula, Session, Terms, Value

Share = tuple[Fraction, ...]
"""A length of each contingent activity, as the share of its case's span that it takes beyond the least one."""


class _Play(Semantics):
    """What the executive decides in one case: choices, orders of events, and what events wait for, as propositions."""

    def __init__(self, game: Game, case: GameCase, terms: Terms) -> None:
        self._game, self.case = game, case
        self.plan = restrict(game.plan, case.values)
        bare = replace(self.plan, network=replace(self.plan.network, constraints=(), activities=()))
        self.known: dict[tuple[str, Sign], Formula] = {}
        """Whether an event waits for a sign."""
        super().__init__(bare, terms, epsilon=game.plan.separation)

    @property
    def orders(self) -> list[tuple[str, str, Formula]]:
        """Which event is before which, where that is open."""
        return [(*pair, order) for pair, order in self._orders.items() if order.is_symbol()]

    def activated(self, guard: model.Guard) -> Formula:
        """The formula that a guard of the whole plan holds."""
        return self.terms.false if model.contradicts(guard, self.case.values) else self.guard(guard - self.case.values)

    def _before(self, earlier: str, later: str) -> Formula:
        pair = (earlier, later)
        if pair not in self._orders:
            both = self._game.guards[earlier] | self._game.guards[later] | self.case.values
            if (self._game.gap(earlier, later, both) or 0) >= self._epsilon:
                self._orders[pair] = self.terms.true
            elif earlier == later or self._game.gap(later, earlier, both) is not None:
                self._orders[pair] = self.terms.false
            else:
                self._orders[pair] = self.terms.fresh_boolean(f"{earlier} before {later} ".replace("%", "%%"))
        return self._orders[pair]

    def needed(self, true: Callable[[Formula], bool]) -> Iterator[tuple[str, str]]:
        """Orders that are true and with which every condition is met."""
        for condition in self.plan.conditions:
            if true(self.guard(condition.guard)):
                threats = [
                    effect
                    for effect in self._effects.get(condition.literal.negation, [])
                    if model.may_threaten(effect, condition) and true(self.guard(effect.guard))
                ]
                producers = self._effects.get(condition.literal, [])
                supports = (self._orders_of(producer, threats, condition, true) for producer in producers)
                yield from next(each for each in supports if each is not None)

    def _orders_of(
        self,
        producer: model.Effect,
        threats: list[model.Effect],
        condition: model.Condition,
        true: Callable[[Formula], bool],
    ) -> list[tuple[str, str]] | None:
        """The orders by which a producer supports a condition; None if it does not."""
        if not true(self.guard(producer.guard)):
            return None
        alternatives = [[(producer.event, condition.first)]] if not model.starts_with(producer, condition) else []
        alternatives += [[(each.event, producer.event), (condition.last, each.event)] for each in threats]
        orders = [next((pair for pair in pairs if true(self._before(*pair))), None) for pairs in alternatives]
        return None if None in orders else [pair for pair in orders if pair is not None]


class Fault(NamedTuple):
    """Lengths that break a policy, as shares; cuts of activities, by number, that may mend it."""

    lengths: list[Share]
    cuts: list[tuple[int, Fraction]]


@dataclass(frozen=True)
class GameBranch:
    """What a policy does in a case: which choices are made, where each event is in its network, what that waits for."""

    case: GameCase
    scenario: Mapping[str, str]
    points: Mapping[str, TimePoint]
    waits: frozenset[tuple[str, Sign]]


@dataclass(frozen=True)
class Policy:
    """A policy that was confirmed; `answer` is about its network."""

    game: Game
    branches: tuple[GameBranch, ...]
    answer: DynamicAnswer


class _Reason(NamedTuple):
    """What a link of a policy's network is due to, the events that it joins, and which length in which case it is."""

    literals: set[Formula]
    events: tuple[str, str]
    length: tuple[int, GameCase] | None


class Plays:
    """One schedule for each case and each of some lengths.

    Args:
        shared: whether choices, orders and knowledge are the same for all lengths of a case, as those of a policy are.
    """

    def __init__(self, game: Game, cases: Sequence[GameCase], *, shared: bool, solver: str = "z3") -> None:
        self.game, self.cases, self.lengths = game, cases, list[Share]()
        self._shared = shared
        self._terms = Terms()
        self._session = Session(self._terms, solver=solver)
        self._plays: dict[tuple[int, int], _Play] = {}
        cuts = {(number, high) for case in cases for number, (_, high) in enumerate(case.spans)}
        cuts -= {(number, game.greatest(each)) for number, (_, each) in enumerate(game.contingent)}
        self._signs = [*(Sign(each.name) for each in game.people), *(Sign(None, *cut) for cut in sorted(cuts))]

    def add(self, share: Share, deadline: Deadline) -> bool:
        """Ask for schedules for these lengths, too; False if that was asked for before."""
        if share in self.lengths:
            return False
        at = len(self.lengths)
        self.lengths.append(share)
        for case in range(len(self.cases)):
            self._session.add_all(self._situation(case, at), deadline)
            for others in range(at):
                self._session.add_all(self._alike((case, at), (case, others)), deadline)
            for other in range(case):
                self._session.add_all(self._alike((case, at), (other, at)), deadline)
        return True

    def exist(self, deadline: Deadline) -> bool:
        """Whether there are such schedules.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        return satisfiable(self._session, "strategy", deadline)

    # -- formulas ----------------------------------------------------------------------------------------------------

    def _play(self, situation: tuple[int, int]) -> _Play:
        key = (situation[0], 0 if self._shared else situation[1])
        if key not in self._plays:
            play = self._plays[key] = _Play(self.game, self.cases[key[0]], self._terms)
            self._session.add(*play.domains, *play.conditions)
            self._session.add(*(self._terms.negation(play.activated(guard)) for guard in self.game.clashes))
            for event in self.game.decided:
                for sign in self._signs:
                    play.known[event, sign] = self._knowledge(play, event, sign)
        return self._plays[key]

    def _knowledge(self, play: _Play, event: str, sign: Sign) -> Formula:
        """Whether the event waits for the sign, a constant where the plan leaves nothing else."""
        game, values = self.game, play.case.values
        shown, delay = self._signal(play.case, sign)
        guard, needed = game.guards[event], game.guards[self._shown_at(sign)]
        if event == shown or model.contradicts(guard | needed, values) or model.contradicts(guard, needed):
            return self._terms.false
        before, after = game.gap(event, shown, guard | needed | values), game.gap(shown, event, guard | values)
        if before is not None and before + delay > 0:
            return self._terms.false
        asks = any(choice.event == event for choice in game.people)
        if needed <= guard | values and after is not None and after >= delay and (after > delay or not asks):
            return self._terms.true
        return self._terms.fresh_boolean("waits ")

    def _shown_at(self, sign: Sign) -> str:
        """The event at which a sign shows at the latest."""
        if sign.choice is not None:
            return str(self.game.choices[sign.choice].event)
        return self.game.contingent[sign.number][1].target

    def _time(self, situation: tuple[int, int], event: str) -> Polynomial[str]:
        if event == model.INITIAL:
            return Polynomial.constant(0)
        return Polynomial.variable(f"{event} in {situation[0]}, {situation[1]}")

    def _bounded(
        self, situation: tuple[int, int], source: str, target: str, lower: Fraction | None, upper: Fraction | None
    ) -> Formula:
        difference = self._time(situation, target) - self._time(situation, source)
        least = [] if lower is None else [self._terms.at_least(difference - lower)]
        most = [] if upper is None else [self._terms.at_least(-difference + upper)]
        return self._terms.conjunction([*least, *most])

    def length(self, situation: tuple[int, int], number: int) -> Fraction:
        """How long a contingent activity takes in a situation."""
        low, high = self.cases[situation[0]].spans[number]
        return low + self.lengths[situation[1]][number] * (high - low)

    def _situation(self, case: int, at: int) -> Iterator[Formula]:
        """A correct schedule of one situation; and that what waits is later than what it waits for."""
        here, terms, game = (case, at), self._terms, self.game
        play = self._play(here)
        for each in game.requirements:
            activated = play.activated(each.guard)
            yield terms.implication(activated, self._bounded(here, each.source, each.target, each.lower, each.upper))
        for number, (_, one) in enumerate(game.contingent):
            length = self.length(here, number)
            yield terms.implication(
                play.activated(one.guard), self._bounded(here, one.source, one.target, length, length)
            )
        for earlier, later, order in play.orders:
            yield terms.implication(order, self._bounded(here, earlier, later, game.plan.separation, None))
        for (event, sign), waits in play.known.items():
            if not waits.is_bool_constant():
                after = (self._after(here, event, sign), *self._ranked(here, event, sign))
                yield terms.implication(waits, terms.conjunction(after))

    def _after(self, here: tuple[int, int], event: str, sign: Sign) -> Formula:
        """The formula that the sign comes up, and shows before the event or at its time."""
        shown, delay = self._signal(self.cases[here[0]], sign)
        activated = self._play(here).activated(self.game.guards[self._shown_at(sign)])
        return self._terms.conjunction((activated, self._bounded(here, shown, event, delay, None)))

    def _signal(self, case: GameCase, sign: Sign) -> tuple[str, Fraction]:
        """The event after which a sign shows in a case, and how much later."""
        if sign.choice is None and case.spans[sign.number][0] >= sign.beyond:
            return self.game.contingent[sign.number][1].source, sign.beyond
        return self._shown_at(sign), Fraction(0)

    def _ranked(self, here: tuple[int, int], event: str, sign: Sign) -> Iterator[Formula]:
        """Choices at one time have an order, so that no two of them are made because of each other."""
        key = (here[0], 0 if self._shared else here[1])
        if sign.choice is not None:
            for choice in self.game.people:
                if choice.event == event:
                    later = Polynomial.variable(f"rank of {event} in {key}")
                    yield self._terms.greater(later - Polynomial.variable(f"rank of {self._shown_at(sign)} in {key}"))

    def _alike(self, one: tuple[int, int], other: tuple[int, int]) -> Iterator[Formula]:
        """The formula that the executive does the same in two situations until it has seen a difference."""
        differing = [sign for sign in self._signs if self._differ(one, other, sign)]
        lengths = (
            []
            if one[0] != other[0]
            else [
                (number, min(self.length(one, number), self.length(other, number)))
                for number in range(len(self.game.contingent))
                if self.length(one, number) != self.length(other, number)
            ]
        )
        for here, there in ((one, other), (other, one)):
            yield from self._follows(here, there, differing, lengths)

    def _differ(self, one: tuple[int, int], other: tuple[int, int], sign: Sign) -> bool:
        first, second = self.cases[one[0]], self.cases[other[0]]
        if sign.choice is not None:
            values = dict(first.values).get(sign.choice), dict(second.values).get(sign.choice)
            return None not in values and values[0] != values[1]
        return (first.spans[sign.number][0] < sign.beyond) != (second.spans[sign.number][0] < sign.beyond)

    def _follows(
        self,
        here: tuple[int, int],
        there: tuple[int, int],
        differing: Sequence[Sign],
        lengths: Sequence[tuple[int, Fraction]],
    ) -> Iterator[Formula]:
        terms, game, mine, theirs = self._terms, self.game, self._play(here), self._play(there)
        first = Polynomial.variable(f"difference of {here} and {there}")
        ended: Formula = terms.false
        if lengths:
            ended = terms.fresh_boolean("ended ")
            activities = [(game.contingent[number][1], length) for number, length in lengths]
            ends = [
                terms.conjunction(
                    (mine.activated(each.guard), terms.at_least(first - self._time(here, each.source) - length))
                )
                for each, length in activities
            ]
            yield terms.implication(ended, terms.disjunction(ends))
        for event in game.decided:
            activated = mine.activated(game.guards[event])
            if activated is terms.false or event == model.INITIAL:
                continue
            seen = [mine.known[event, sign] for sign in differing]
            if lengths:
                seen.append(terms.conjunction((ended, terms.at_least(self._time(here, event) - first))))
            same = [theirs.activated(game.guards[event])]
            if same[0] is not terms.false:
                same.append(terms.equal(self._time(here, event) - self._time(there, event)))
                same += [] if mine is theirs else self._same_choices(event, mine, theirs)
            yield terms.disjunction((terms.negation(activated), *seen, terms.conjunction(same)))

    def _same_choices(self, event: str, mine: _Play, theirs: _Play) -> Iterator[Formula]:
        for choice in self.game.choices.values():
            for value in choice.domain if choice.event == event and choice.controllable else ():
                literal = frozenset({model.Assignment(choice.name, value)})
                yield self._terms.equivalence(mine.guard(literal), theirs.guard(literal))

    # -- policies ----------------------------------------------------------------------------------------------------

    def policy(self, at: int, deadline: Deadline) -> Policy | Fault:
        """The policy of the last model, for all lengths if it is shared, or as of one of them: confirmed, or its fault.

        Policies with the same fault are excluded from then on, if they are shared.
        """
        policy = _PolicyNetwork(self, at, self._values(at))
        answer = dynamic(Stnu(policy.points, tuple(policy.links)), deadline)
        if answer.cycle is None:
            return Policy(self.game, tuple(policy.branches), answer)
        weight, steps = weight_in(answer.form.stnu), answer.cycle.steps
        infinite, finite = total(steps, weight)
        literals: set[Formula] = set()
        ways: dict[tuple[int, GameCase], list[Way]] = {}
        for step in steps:
            reason = policy.reasons[step.link]
            literals |= reason.literals.union(*(policy.merged.get(event, set()) for event in reason.events))
            if reason.length is not None and step.way in {Way.SHORTEST, Way.LONGEST}:
                ways.setdefault(reason.length, []).append(step.way)
        if self._shared:
            self._session.add(self._terms.negation(self._terms.conjunction(sorted(literals, key=str))))
        cuts = []
        for (number, case), passed in ways.items() if not infinite else ():
            (low, high), room = case.spans[number], -finite / len(passed)
            cut = high - room if Way.LONGEST in passed else low + room
            cuts += [(number, cut)] if low < cut < high else []
        by_number: dict[int, set[Fraction]] = {}
        for (number, _), passed in ways.items():
            by_number.setdefault(number, set()).update(Fraction(way is Way.LONGEST) for way in passed)
        options = [sorted(by_number.get(number, {share})) for number, share in enumerate(self.lengths[at])]
        return Fault(list(islice(product(*options), 4)), cuts)

    def _values(self, at: int) -> Mapping[str, Value]:
        plays = [self._play((case, at)) for case in range(len(self.cases))]
        symbols = {
            symbol
            for play in plays
            for formula in chain(play.choices, play._orders.values(), play.known.values())
            for symbol in self._terms.variables(formula)
        }
        return self._session.values(symbols)


class _PolicyNetwork:
    """The network of a policy: the links of all cases between events that are merged where nothing tells them apart."""

    def __init__(self, plays: Plays, at: int, values: Mapping[str, Value]) -> None:
        self._plays, self._at, self._values = plays, at, values
        self._all = [plays._play((case, at)) for case in range(len(plays.cases))]
        game = plays.game
        self.merged: dict[str, set[Formula]] = {}
        """By event, why it is merged."""
        chosen = [play.chosen(values) | dict(play.case.values) for play in self._all]
        self._live = [{event for event, guard in game.guards.items() if holds(guard, each)} for each in chosen]
        self._parent = {(case, event): (case, event) for case, live in enumerate(self._live) for event in live}
        self._merge()
        self.branches = [
            GameBranch(
                play.case,
                scenario,
                {event: self._point(case, event) for event in sorted(self._live[case])},
                frozenset(awaited for awaited, waits in play.known.items() if self._true(waits)),
            )
            for case, (play, scenario) in enumerate(zip(self._all, chosen, strict=True))
        ]
        self.points = tuple(dict.fromkeys([ZERO, *(point for each in self.branches for point in each.points.values())]))
        self._links: dict[tuple[object, ...], UncertainLink[Fraction]] = {}
        self.reasons: list[_Reason] = []
        for case in range(len(self._all)):
            self._link_case(case)
        self.links = list(self._links.values())

    def _true(self, formula: Formula) -> bool:
        if formula.is_bool_constant():
            return bool(formula.constant_value())
        if formula.is_and():
            return all(map(self._true, formula.args()))
        if formula.is_not():
            return not self._true(formula.arg(0))
        return bool(self._values[formula.symbol_name()])

    def _root(self, node: tuple[int, str]) -> tuple[int, str]:
        while self._parent[node] != node:
            self._parent[node] = node = self._parent[self._parent[node]]
        return node

    def _point(self, case: int, event: str) -> TimePoint:
        if event == model.INITIAL:
            return ZERO
        root, name = self._root((case, event))
        return TimePoint(TimePointKind.INSTANT, f"{name} in case {root + 1}")

    def _merge(self) -> None:
        """Events are one where a case does not wait for what tells it from another; ends are, where starts are."""
        plays, game, negation = self._plays, self._plays.game, self._plays._terms.negation
        pairs = list(combinations(range(len(self._all)), 2))
        for one, other in pairs:
            differing = [sign for sign in plays._signs if plays._differ((one, self._at), (other, self._at), sign)]
            for event in sorted((self._live[one] & self._live[other]) - game.ends):
                for play in (self._all[one], self._all[other]):
                    waits = [play.known[event, sign] for sign in differing]
                    if not any(map(self._true, waits)):
                        self._parent[self._root((one, event))] = self._root((other, event))
                        why = self.merged.setdefault(event, set())
                        why.update(map(negation, waits))
                        why.update(each.activated(game.guards[event]) for each in (self._all[one], self._all[other]))
        for number, (_, each) in enumerate(game.contingent):
            for one, other in pairs:
                both = {each.source, each.target} <= self._live[one] & self._live[other]
                alike = self._all[one].case.spans[number] == self._all[other].case.spans[number]
                if both and alike and self._root((one, each.source)) == self._root((other, each.source)):
                    self._parent[self._root((one, each.target))] = self._root((other, each.target))
                    self.merged.setdefault(each.target, set()).update(self.merged.get(each.source, ()))

    def _link_case(self, case: int) -> None:
        plays, game, play = self._plays, self._plays.game, self._all[case]
        live = self._live[case]
        for each in game.requirements:
            if self._true(play.activated(each.guard)):
                self._link(case, each, {play.activated(each.guard)}, _words(each))
        for number, (_, one) in enumerate(game.contingent):
            if self._true(play.activated(one.guard)):
                low, high = play.case.spans[number]
                most = None if one.upper is None and high == game.greatest(one) else high
                link = model.Constraint(one.source, one.target, low, most, one.guard)
                self._link(case, link, {play.activated(one.guard)}, one.action, (number, play.case))
        for earlier, later in play.needed(self._true):
            link = model.Constraint(earlier, later, game.plan.separation, None)
            self._link(case, link, {play._before(earlier, later)}, _words(link))
        for (event, sign), waits in play.known.items():
            if event in live and self._true(waits):
                shown, delay = plays._signal(play.case, sign)
                if shown in live:
                    self._link(case, model.Constraint(shown, event, delay, None), {waits}, f"{event} after {shown}")

    def _link(
        self,
        case: int,
        each: model.Constraint,
        literals: set[Formula],
        words: str,
        length: tuple[int, GameCase] | None = None,
    ) -> None:
        link = UncertainLink(
            self._point(case, each.source),
            self._point(case, each.target),
            each.lower,
            each.upper,
            length is not None,
            "" if length is None else words,
            "" if length is not None else words,
        )
        key = (link.source, link.target, link.lower, link.upper, link.is_contingent)
        if key not in self._links:
            self._links[key] = link
            self.reasons.append(_Reason(literals, (each.source, each.target), length))


def _words(each: model.Constraint) -> str:
    bounds = f"[{'-inf' if each.lower is None else each.lower}, {'inf' if each.upper is None else each.upper}]"
    return f"{each.source} to {each.target} in {bounds}"
