"""How likely it is that people's choices leave a correct execution: the future work of [PIKE §7], exactly.

The plan says how likely the values of its uncontrollable choices are, in tables that may depend on other choices. All
choices are put in one order that the plan allows. In this order people's choices follow their tables, and the team
makes each of its own such that success is most likely by what was decided before: the value of a decision tree whose
leaves are team scenarios, each of which admits a correct execution or does not.

The tree is never written down. Its leaves are known from the diagrams of the πTMS, from which support and order are
eliminated, and in which equal subtrees are one; or the semantic oracle is asked about one branch after the other, and
what time does not suffice for stays open, between 0 and 1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import reduce
from itertools import chain
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from robust.errors import InputError, UnsupportedError
from robust.pike_bridge import model, semantics
from robust.pike_bridge.compile import ORACLE, PITMS, Compiling
from robust.pike_bridge.knowledge import goal, tms
from robust.pike_bridge.online.progress import Structure
from robust.pike_bridge.theory import Require, connected, evaluate, narrowing
from robust.searching import Searching, Status, Stoppable
from robust.smt.limits import NEVER, Deadline

ONE = Fraction(1)
State = TypeVar("State", bound=Hashable)


class ChanceBounds(NamedTuple):
    """A probability: the same number twice unless something is open."""

    lower: Fraction = Fraction(0)
    upper: Fraction = Fraction(1)


OPEN = ChanceBounds()
IMPOSSIBLE, CERTAIN = ChanceBounds(upper=Fraction(0)), ChanceBounds(ONE)


def order_of_choices(plan: model.TeamPlan, *, people_first: bool = True) -> tuple[model.Choice, ...]:
    """The choices in an order that the plan allows; where it allows several, people's first, or else the team's.

    A choice is after those that its tables and the guard of its event are about, and after those that are made at
    events which are never later than its own. Of the team's, those that people's choices wait for are first.

    Raises:
        InputError: if probabilities depend on each other in a circle.
    """
    structure = Structure(plan)
    waits_for = {}
    for choice in plan.network.choices:
        labels = [row.guard for row in choice.probability]
        needed: set[str] = set()
        if choice.event is not None:
            labels.append(structure.guards[choice.event])
            before = structure.preceding(choice.event) - {choice.event}
            needed.update(chain.from_iterable(structure.made_at.get(event, ()) for event in before))
        waits_for[choice.name] = needed.union(*({variable for variable, _ in label} for label in labels)) - {
            choice.name
        }
    remaining = {choice.name: choice for choice in plan.network.choices}
    order = []
    while remaining:
        free = [choice for choice in remaining.values() if not waits_for[choice.name] & remaining.keys()]
        if not free:
            raise InputError(
                f"found probabilities that depend on each other: {', '.join(remaining)}; expected none that do"
            )
        awaited = set().union(*(waits_for[name] for name in remaining))
        order.append(min(free, key=lambda each: (each.controllable is people_first, each.name not in awaited)))
        del remaining[order[-1].name]
    return tuple(order)


def probabilities(choice: model.Choice, decided: Mapping[str, str]) -> Mapping[str, Fraction]:
    """How likely each value of a choice of people is, by what was decided before; without tables all alike."""
    for row in choice.probability:
        if all(decided.get(variable) == value for variable, value in row.guard):
            return dict(row.values)
    return dict.fromkeys(choice.domain, Fraction(1, len(choice.domain)))


class ScenarioLeaves(ABC, Generic[State]):
    """Which team scenarios admit a correct execution, found out choice by choice in the order of a tree."""

    start: State

    @abstractmethod
    def after(self, state: State, choice: model.Choice, value: str) -> State:
        """What is left once a choice has a value."""

    @abstractmethod
    def chance(self, state: State) -> ChanceBounds:
        """The probability of a correct execution, where all choices are made."""


class DiagramLeaves(ScenarioLeaves[tuple[int, ...]]):
    """Scenarios by some parts of the goal of the πTMS."""

    def __init__(
        self, whole: goal.Goal, parts: Iterable[goal.Part], order: Sequence[model.Choice], deadline: Deadline
    ) -> None:
        self._places = {choice.name: place for place, choice in enumerate(order)}
        self._functions = goal.Functions([len(choice.domain) for choice in order], whole.diagrams.functions.largest)
        first = [(choice.name, choice.domain[0]) for choice in order]
        places = {variable: place for place, (variable, _) in enumerate(whole.diagrams.choices(first))}
        project = whole.diagrams.functions.projected
        self.start = tuple(project(part.function, self._functions, places, deadline) for part in parts)

    def after(self, state: tuple[int, ...], choice: model.Choice, value: str) -> tuple[int, ...]:
        place, number = self._places[choice.name], choice.domain.index(value)
        remaining = {self._functions.left(each, place, number) for each in state}
        return (goal.FALSE,) if goal.FALSE in remaining else tuple(sorted(remaining - {goal.TRUE}))

    def chance(self, state: tuple[int, ...]) -> ChanceBounds:
        return IMPOSSIBLE if goal.FALSE in state else CERTAIN


class OracleLeaves(ScenarioLeaves[model.Guard | None]):
    """Scenarios by the semantic oracle, which is asked about each branch; None is left where none is correct."""

    def __init__(self, plan: model.TeamPlan, solver: str, known: model.Guard, deadline: Deadline) -> None:
        self._oracle = semantics.Oracle(plan, solver=solver)
        self._guards = plan.network.guards
        self._deadline = deadline
        self._correct: model.Guard = model.ALWAYS
        self._unknown: set[model.Guard] = set()
        self.start = self._asked(known)

    def after(self, state: model.Guard | None, choice: model.Choice, value: str) -> model.Guard | None:
        if state is None or state in self._unknown:
            return state
        if choice.event is not None and model.contradicts(state, self._guards[choice.event]):
            return state  # it is never made
        return self._asked(state | {model.Assignment(choice.name, value)})

    def chance(self, state: model.Guard | None) -> ChanceBounds:
        return IMPOSSIBLE if state is None else OPEN if state in self._unknown else CERTAIN

    def _asked(self, environment: model.Guard) -> model.Guard | None:
        if environment <= self._correct:
            return environment
        answer = self._oracle.decide(environment, deadline=self._deadline)
        if answer.witness is not None:
            self._correct = model.guard(answer.witness.scenario)
        elif answer.verdict is semantics.ExecutionExistence.UNKNOWN:
            self._unknown.add(environment)
        return None if answer.verdict is semantics.ExecutionExistence.NONE else environment


@dataclass(frozen=True, slots=True)
class IntentChance:
    """A value that people may choose.

    Attributes:
        probability: that they do, by what is known.
        success: how likely success is if they do; None if they never do.
    """

    choice: str
    value: str
    probability: Fraction
    success: ChanceBounds | None


class Share(NamedTuple):
    """What is ahead in a tree: how likely what is known already is, and that with success."""

    known: Fraction
    lower: Fraction
    upper: Fraction

    def plus(self, share: Fraction, other: Share) -> Share:
        """What is ahead here, and with some probability elsewhere."""
        return Share(*(own + share * more for own, more in zip(self, other, strict=True)))

    @property
    def success(self) -> ChanceBounds:
        return ChanceBounds(self.lower / self.known, self.upper / self.known) if self.known else IMPOSSIBLE


NOWHERE = Share(Fraction(0), Fraction(0), Fraction(0))
Memory: TypeAlias = tuple[tuple[str, str], ...]
"""Decisions that tables of later choices are about."""
Subtree: TypeAlias = tuple[int, State, Memory]
"""Which choice is next, what is left of the leaves, and what has to be remembered."""


class DecisionTree(Generic[State]):
    """The tree of choices in one order, with equal subtrees as one.

    Args:
        order: the choices; tables are about choices in it only.
        known: values of those that are made.
    """

    def __init__(
        self, order: Sequence[model.Choice], leaves: ScenarioLeaves[State], known: Mapping[str, str], deadline: Deadline
    ) -> None:
        self._order, self._leaves, self._known, self._deadline = order, leaves, known, deadline
        self._recalled = [
            {variable for later in order[place:] for row in later.probability for variable, _ in row.guard}
            for place in range(len(order) + 1)
        ]
        """By place, what tables from there on are about."""
        self._outlooks: dict[Subtree[State], Share] = {}
        self._branchings: dict[Subtree[State], dict[str, tuple[Fraction, Subtree[State]]]] = {}
        self._root: Subtree[State] = (0, leaves.start, ())
        self._is_open = False
        """Whether it is not known which value is the best where what is known depends on it."""

    def outlook(self) -> Share:
        """From the beginning.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        share = evaluate(self._root, self._outlooks, self._step, self._deadline)
        return share._replace(upper=share.known) if self._is_open else share

    def intents(self) -> list[IntentChance]:
        """Each value of each of people's choices that are not made, if the team decides for the best."""
        total = self.outlook().known
        masses: defaultdict[tuple[str, str], Share] = defaultdict(lambda: NOWHERE)
        reached: dict[Subtree[State], Fraction] = {self._root: ONE}
        for choice in self._order:
            following: defaultdict[Subtree[State], Fraction] = defaultdict(Fraction)
            for subtree, share in reached.items():
                branches = self._branches(subtree)
                for value in [self._best(branches)] if self._is_ours(choice) else branches:
                    weight, after = branches[value]
                    following[after] += share * weight
                    masses[choice.name, value] = masses[choice.name, value].plus(share * weight, self._outlooks[after])
            reached = following
        return [
            IntentChance(
                choice.name,
                value,
                masses[choice.name, value].known / total,
                masses[choice.name, value].success if masses[choice.name, value].known else None,
            )
            for choice in self._order
            if not choice.controllable and choice.name not in self._known
            for value in choice.domain
        ]

    def _is_ours(self, choice: model.Choice) -> bool:
        return choice.controllable and choice.name not in self._known

    def _branches(self, branch: Subtree[State]) -> dict[str, tuple[Fraction, Subtree[State]]]:
        """By value of the next choice, how likely it is, and what comes after; one of ours is as likely as we want."""
        if branch in self._branchings:
            return self._branchings[branch]
        place, state, memory = branch
        choice, decided = self._order[place], dict(memory)
        weights = dict.fromkeys(choice.domain, ONE) if choice.controllable else dict(probabilities(choice, decided))
        if choice.name in self._known:  # what has happened is possible, whatever tables say
            value = self._known[choice.name]
            weights = {value: weights[value] or ONE}
        branches = self._branchings[branch] = {}
        for value, weight in weights.items():
            if weight:
                made = {**decided, choice.name: value}
                kept = tuple(sorted(item for item in made.items() if item[0] in self._recalled[place + 1]))
                branches[value] = weight, (place + 1, self._leaves.after(state, choice, value), kept)
        return branches

    def _best(self, branches: Mapping[str, tuple[Fraction, Subtree[State]]]) -> str:
        """The value with which success is most likely; of several the first."""
        return max(branches, key=lambda value: self._outlooks[branches[value][1]].success)

    def _step(self, branch: Subtree[State]) -> Share | list[Subtree[State]]:
        if branch[0] == len(self._order):
            return Share(ONE, *self._leaves.chance(branch[1]))
        branches = self._branches(branch)
        missing = [after for _, after in branches.values() if after not in self._outlooks]
        if missing:
            return missing
        if self._is_ours(self._order[branch[0]]):
            ahead = [self._outlooks[after] for _, after in branches.values()]
            best = self._outlooks[branches[self._best(branches)][1]]
            if len({each.known for each in ahead}) > 1:  # each value makes what is known as likely as it likes
                self._is_open = self._is_open or any(each.lower < each.upper for each in ahead)
                return best
            return best._replace(upper=max(each.upper for each in ahead))
        outlook = NOWHERE
        for weight, after in branches.values():
            outlook = outlook.plus(weight, self._outlooks[after])
        return outlook


@dataclass(frozen=True, slots=True)
class TeamChance(Stoppable, ask="success"):
    """How likely success is.

    Attributes:
        backend: who knows which scenarios admit a correct execution.
        status: `complete`, or what ended the search; bounds are right all the same.
        order: the choices in the order in which they are taken: people's first where the plan leaves that open.
        success: how likely it is that a correct execution is left, if choices come in that order.
        hasty: how likely, if the team's choices come first where the plan leaves that open.
        intents: what people may choose, as far as that is not known; empty if time did not suffice.
        uniform: choices of people about which the plan says nothing: their values count as equally likely.
    """

    backend: str
    status: str
    order: tuple[str, ...]
    success: ChanceBounds
    hasty: ChanceBounds
    intents: tuple[IntentChance, ...]
    uniform: tuple[str, ...]
    seconds: float = field(compare=False)
    reason: str | None = None


class Forecast:
    """Chances of a plan by its knowledge base, or by the oracle.

    Args:
        plan: the plan.
        whole: all its correct executions in which the known choices are made; None: the oracle is asked.
        known: choices that are made.

    Raises:
        InputError: if probabilities depend on each other in a circle.
        OutOfTimeError: if the deadline passes.
    """

    def __init__(
        self,
        plan: model.TeamPlan,
        whole: goal.Goal | None,
        known: model.Guard = model.ALWAYS,
        *,
        people_first: bool = True,
        solver: str = "z3",
        deadline: Deadline,
    ) -> None:
        self.order = order_of_choices(plan, people_first=people_first)
        self._trees: list[DecisionTree[tuple[int, ...]] | DecisionTree[model.Guard | None]] = []
        if whole is None:
            leaves = OracleLeaves(plan, solver, known, deadline)
            self._trees.append(DecisionTree(self.order, leaves, dict(known), NEVER))  # what is left is open
            return
        names = {choice.name for choice in self.order}
        parts = [(_variables(part, whole) & names, part) for part in whole.parts]
        scopes = [scope for scope, _ in parts]
        scopes += [frozenset({choice.name, *_mentioned(choice)}) for choice in self.order]
        for group in connected(scopes, lambda scope: scope):
            together = frozenset().union(*group)
            order = [choice for choice in self.order if choice.name in together]
            own = [part for scope, part in parts if scope & together or scope == together]
            self._trees.append(DecisionTree(order, DiagramLeaves(whole, own, order, deadline), dict(known), deadline))

    @property
    def success(self) -> ChanceBounds:
        """How likely a correct execution is left; trees are independent of each other."""
        return _all_of(tree.outlook().success for tree in self._trees)

    def intents(self) -> list[IntentChance]:
        """What people may choose, in the order of choices."""
        intents: list[IntentChance] = []
        for tree in self._trees:
            others = _all_of(other.outlook().success for other in self._trees if other is not tree)
            intents += (
                intent if intent.success is None else replace(intent, success=_all_of((intent.success, others)))
                for intent in tree.intents()
            )
        places = {choice.name: place for place, choice in enumerate(self.order)}
        return sorted(intents, key=lambda intent: places[intent.choice])


def chance_answer(success: ChanceBounds, intents: Iterable[IntentChance]) -> dict[str, Any]:
    """For JSON: how likely success is while a plan runs, and each value of people's open choices."""
    likely: dict[str, dict[str, str]] = {}
    for intent in intents:
        likely.setdefault(intent.choice, {})[intent.value] = str(intent.probability)
    return {"success": str(success.lower), "intents": likely}


def _all_of(chances: Iterable[ChanceBounds]) -> ChanceBounds:
    """The chance of independent events together."""
    return reduce(lambda one, other: ChanceBounds(one.lower * other.lower, one.upper * other.upper), chances, CERTAIN)


def _mentioned(choice: model.Choice) -> set[str]:
    return {variable for row in choice.probability for variable, _ in row.guard}


def _variables(part: goal.Part, whole: goal.Goal) -> frozenset[str]:
    """The names of the variables of a part."""
    some = ((variable, 0) for variable in part.variables)
    return frozenset(each.variable for each in whole.diagrams.decode(some))


@dataclass
class ChanceSearch(Compiling, Searching[TeamChance]):
    """Finds out how likely success is.

    Args:
        backend: `pitms`, or `oracle`, whose bounds are as good as there was time.
        assume: choices that are made already.
    """

    assume: model.Guard = model.ALWAYS

    def __post_init__(self) -> None:
        self._order: tuple[model.Choice, ...] = ()
        self._success = self._hasty = OPEN
        self._intents: tuple[IntentChance, ...] = ()

    def _result(self, status: Status, reason: str | None = None) -> TeamChance:
        complete = self._success.lower == self._success.upper and self._hasty.lower == self._hasty.upper
        ended = Status.TIMEOUT if status is Status.COMPLETE and not complete else status
        choices = self.plan.network.choices
        return TeamChance(
            self.backend,
            ended.value,
            tuple(choice.name for choice in self._order),
            self._success,
            self._hasty,
            self._intents,
            tuple(each.name for each in choices if not (each.controllable or each.probability)),
            sum(self.seconds.values()),
            reason,
        )

    def _search(self) -> None:
        self._order = order_of_choices(self.plan)
        whole = None
        if self.backend != ORACLE:
            knowledge = self.compile().knowledge
            if not isinstance(knowledge, tms.PiTms):
                raise UnsupportedError(f"back end {self.backend} counts no weights; expected {PITMS} or {ORACLE}")
            knowledge.commit([Require(self.assume)], self.deadline)
            whole = knowledge.goal
        with self.stage("counting"):
            patient, hasty = (
                Forecast(self.plan, whole, self.assume, people_first=first, solver=self.solver, deadline=self.deadline)
                for first in (True, False)
            )
            self._success, self._intents = patient.success, tuple(patient.intents())
            self._hasty = hasty.success


class LikelyChoices:
    """Orders values of the team's choices by the success that they leave.

    Values that keep success at least as likely as is wanted come first, those that serve more of what people may choose
    before others: success is more likely with them if all that people may choose is equally likely. Then come the
    others, those before with which success is more likely.

    Args:
        plan: the plan, with probabilities.
        wanted: how likely success is to stay.

    Raises:
        OutOfTimeError: if the deadline passes while the knowledge base is compiled.
    """

    def __init__(self, plan: model.TeamPlan, wanted: Fraction, *, solver: str = "z3", deadline: Deadline) -> None:
        knowledge = Compiling(plan, PITMS, solver=solver, deadline=deadline).compile().knowledge
        if not isinstance(knowledge, tms.PiTms):
            raise UnsupportedError(f"back end {knowledge.name} counts no weights; expected {PITMS}")
        self._goal, self._theory = knowledge.goal, knowledge.theory
        self._plan, self._wanted, self._deadline = plan, wanted, deadline
        network = plan.network
        alike = replace(network, choices=tuple(replace(choice, probability=()) for choice in network.choices))
        self._uniform = replace(plan, network=alike)

    def forecast(self, known: Mapping[str, str], *, uniform: bool = False) -> Forecast:
        """What is likely once some choices are made, or would be if people's choices were all equally likely."""
        made = model.guard(known)
        whole = self._goal.narrowed(narrowing([Require(made)], self._theory), self._deadline)
        return Forecast(self._uniform if uniform else self._plan, whole, made, deadline=self._deadline)

    def __call__(self, choice: str, values: Sequence[str], known: Mapping[str, str]) -> Sequence[str]:
        """The values of a choice, the best one first."""

        def merit(value: str) -> tuple[bool, Fraction, Fraction]:
            made = {**known, choice: value}
            chance = self.forecast(made).success.lower
            enough = chance >= self._wanted
            return enough, self.forecast(made, uniform=True).success.lower if enough else chance, chance

        return sorted(values, key=merit, reverse=True) if len(values) > 1 else values


def learnt(plan: model.TeamPlan, observations: Iterable[Mapping[str, str]]) -> model.TeamPlan:
    """The plan with what people chose in earlier executions as probabilities of their choices.

    Of n observations k of which have one of d values, its probability is (k + 1) / (n + d): Laplace's rule, by which
    nothing is impossible because it has not been seen. Choices that were never observed stay as they are.

    Args:
        plan: what :func:`robust.pike.load` returns.
        observations: for each execution the values of the choices that were made in it, by their names.

    Returns:
        The plan with these probabilities in place of its own.

    Raises:
        InputError: for a choice that the plan does not have, and a value that its choice does not have.
    """
    seen = [dict(each) for each in observations]
    for each in seen:
        for name, value in each.items():
            model.check_choice(plan.network.domains, name, value)

    def with_table(choice: model.Choice) -> model.Choice:
        counts = Counter(each[choice.name] for each in seen if choice.name in each)
        if choice.controllable or not counts:
            return choice
        total = counts.total() + len(choice.domain)
        shares = tuple((value, Fraction(counts[value] + 1, total)) for value in choice.domain)
        return replace(choice, probability=(model.Likelihood(shares),))

    network = replace(plan.network, choices=tuple(map(with_table, plan.network.choices)))
    return replace(plan, network=network)
