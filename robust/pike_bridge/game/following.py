"""Executives that follow a strategy: what is seen decides which branches are left, and what is ready is executed.

The strategy's network has the events of all branches. Those of a branch that is left happen as they do in the plan;
all others are simulated: executed when they are ready, and ended as soon as they may be, or at their greatest length
once that is known to be exceeded. Each event is executed as soon as the dispatchable network says that it may
(Morris, 2014).

As long as people choose when they are asked to, and activities keep to their bounds, every execution succeeds. Where
they do not, the strategy says nothing; from then on the semantic reasoner decides as it does without a strategy.
"""

from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, dataclass, replace
from fractions import Fraction
from functools import partial
from typing import NamedTuple

from robust.errors import RefutedError, UnsupportedError
from robust.network.dispatchable import Windows
from robust.network.dispatchable import strategy as dispatch_network
from robust.network.uncertain import DynamicAnswer
from robust.pike_bridge.game.controllability import DecidingControllability, Strategy
from robust.pike_bridge.game.deciding import ControllabilityVerdict
from robust.pike_bridge.game.dividing import PartPolicy, within
from robust.pike_bridge.game.plays import GameBranch
from robust.pike_bridge.game.rules import GameRules
from robust.pike_bridge.model import Guard, TeamPlan
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.reasoners import make_semantic
from robust.pike_bridge.online.semantic import News, Reasoner
from robust.pike_bridge.online.world import Ending, ExecutionRecord, Human, Rehearsal
from robust.searching import Announce, Status, unheard
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

STRATEGY = "strategy"


class _SimulatedMoment(NamedTuple):
    """When a node happens that is simulated; or when an activity is known to take longer than a branch says."""

    time: Fraction
    node: int
    exceeded: bool


class StrategyReasoner(Reasoner):
    """Says what a strategy does, in the terms of executives that act as soon as they can."""

    name = STRATEGY

    def __init__(self, progress: Progress, strategy: Strategy, *, solver: str = "z3") -> None:
        super().__init__(progress)
        self._solver = solver
        self._strategy, self._at = strategy, 0
        self._under_way = _PolicyFollower(progress, strategy.parts[0], strategy.parts[0].policy.answer)
        self._taken = 0
        """How many events of the plan were taken account of."""
        self._without: Reasoner | None = None
        """Decides once something was not as the strategy supposes."""

    @property
    def is_followed(self) -> bool:
        """Whether everything was as the strategy supposes, so far."""
        return self._without is None

    def _next_part(self) -> "_PolicyFollower | None":
        """The next part with all the time that is left for it; None if that is not enough."""
        strategy, times = self._strategy, self.progress.times
        self._at += 1
        coming = strategy.parts[self._at]
        left = []
        for limit in strategy.limits:
            if self._at in limit.parts:
                first = strategy.parts[limit.parts[0]].part.first
                later = (strategy.parts[at].span or Fraction(0) for at in limit.parts if at > self._at)
                left.append(limit.most - (times[coming.part.first] - times[first]) - sum(later, Fraction(0)))
        policy = coming.policy
        answer = within(policy, coming.part, min(left)) if left else policy.answer
        return None if answer.cycle is not None else _PolicyFollower(self.progress, coming, answer)

    # -- questions ---------------------------------------------------------------------------------------------------

    def executable(self, event: str, deadline: Deadline) -> bool:
        self.catch_up()
        if self._without is not None:
            return self._without.executable(event, deadline)
        return self._under_way.executable(event)

    def could(self, environment: Guard, deadline: Deadline) -> bool:
        self.catch_up()
        if self._without is not None:
            return self._without.could(environment, deadline)
        if not self.progress.compatible(environment):
            return False
        wanted = {**dict(environment), **self.progress.chosen}
        coming = [each.policy.branches for each in self._strategy.parts[self._at + 1 :]]
        return all(
            any(all(wanted.get(name, value) == value for name, value in branch.scenario.items()) for branch in branches)
            for branches in (self._under_way.branches, *coming)
        )

    def next_time(self, deadline: Deadline) -> Fraction | None:
        self.catch_up()
        if self._without is not None:
            return self._without.next_time(deadline)
        return min((moment for moment in self._under_way.moments() if moment > self.progress.now), default=None)

    # -- what has happened -------------------------------------------------------------------------------------------

    def _learn(self, news: News) -> None:
        progress = self.progress
        if self._without is not None:
            return
        for event, time in list(progress.times.items())[self._taken :]:
            self._under_way.happened(event, time)
            self._taken += 1
            if event == self._under_way.last and self._at + 1 < len(self._strategy.parts):
                following = self._next_part()
                if following is None:
                    break
                self._under_way = following
                following.happened(event, time)
        else:
            self._under_way.advance(progress.now)
            if not progress.void and not self._under_way.is_lost():
                return
        self._without = make_semantic(progress, solver=self._solver)


class _PolicyFollower:
    """Follows the policy of one part of a plan, which is under way or comes next."""

    def __init__(self, progress: Progress, own: PartPolicy, answer: DynamicAnswer) -> None:
        part, policy, links = own.part, own.policy, answer.form.stnu.contingents
        self._progress, self._people = progress, policy.game.people
        self._part, self.last = part, part.last
        self._network = dispatch_network(answer, links)
        self._windows = Windows(self._network)
        self._begins = {self._network.index[link.target]: self._network.index[link.source] for link in links}
        self._spans = {self._network.index[link.target]: (link.lower or Fraction(0), link.upper) for link in links}
        shown = part.events & progress.structure.guards.keys()
        self._shown = {
            id(each): frozenset(self._network.index[point] for event, point in each.points.items() if event in shown)
            for each in policy.branches
        }
        """The nodes of each branch that are events of the plan; those of asking are simulated, whatever happens."""
        self.branches = list(policy.branches)
        """Those that are left by what was seen at events that have happened."""
        self._now = Fraction(0)
        """Until when the network was simulated."""

    def executable(self, event: str) -> bool:
        """Whether the policy executes an event now."""
        nodes = {self._node(each, event) for each in self.branches}
        node = nodes.pop() if len(nodes) == 1 else None
        if node is None:
            return False
        if node in self._begins:  # a choice that was asked for
            return self._begins[node] in self._windows.times
        ready = self._ready(node)
        return ready is not None and ready <= self._progress.now

    def moments(self) -> Iterator[Fraction]:
        """Times from which on more is executed, or known not to have happened."""
        yield from (each.time for each in self._moments())
        for node in self._real():
            if node not in self._windows.times:
                ready, upper = self._ready(node), self._windows.upper[node]
                if ready is not None:
                    yield ready
                if upper is not None:
                    yield upper + self._progress.grid  # late, if nothing happens

    def is_lost(self) -> bool:
        """Whether something is not as the policy supposes."""
        late = (node for node in self._real() - self._windows.times.keys())
        return not self.branches or any(self._windows.is_late(node, self._progress.now) for node in late)

    def happened(self, event: str, time: Fraction) -> None:
        """Take account of an event of the plan, and of the choices and lengths that show with it."""
        self.advance(time)
        if event == self._part.first and 0 not in self._windows.times:
            self._windows.happened(0, time - self._part.begins)
        made = {choice.name for choice in self._people if choice.event == event}
        seen = {name: value for name, value in self._progress.chosen.items() if name in made}
        self.branches = [
            each
            for each in self.branches
            if all(each.scenario.get(name) == value for name, value in seen.items()) and self._fits(each, event, time)
        ]
        for node in {self._node(each, event) for each in self.branches}:
            if node is not None:
                self._windows.happened(node, time)

    def _fits(self, branch: GameBranch, event: str, time: Fraction) -> bool:
        """Whether the event is in a branch; if it ends an activity, with a length that the branch says."""
        node = self._node(branch, event)
        if node is None or node not in self._begins:
            return node is not None
        low, high = self._spans[node]
        begun = self._windows.times.get(self._begins[node])
        return begun is not None and low <= time - begun and (high is None or time - begun <= high)

    # -- what is simulated -------------------------------------------------------------------------------------------

    def advance(self, now: Fraction) -> None:
        """Simulate until a time."""
        while (moment := min(self._moments(), default=None)) is not None and moment.time <= now:
            self._now = moment.time
            self._windows.happened(moment.node, moment.time)
            if moment.exceeded:
                self.branches = [each for each in self.branches if moment.node not in self._nodes(each)]
        self._now = max(self._now, now)

    def _moments(self) -> Iterator[_SimulatedMoment]:
        """What happens next that the plan does not show."""
        real, happened = self._real(), self._windows.times
        for node in range(1, len(self._network.points)):
            if node in happened:
                continue
            begun = happened.get(self._begins[node]) if node in self._begins else None
            if node in real:
                high = self._spans[node][1] if begun is not None else None
                if begun is not None and high is not None and any(node not in self._nodes(b) for b in self.branches):
                    yield _SimulatedMoment(begun + high, node, True)
            elif node in self._begins:
                if begun is not None:
                    yield _SimulatedMoment(max(begun + self._spans[node][0], self._now), node, False)
            elif (ready := self._ready(node)) is not None:
                yield _SimulatedMoment(max(ready, self._now), node, False)

    def _ready(self, node: int) -> Fraction | None:
        """When a node may be executed; None if it waits for another one."""
        if node == 0:
            return Fraction(0)
        return self._windows.ready(node) if 0 in self._windows.times else None

    def _node(self, branch: GameBranch, event: str) -> int | None:
        point = branch.points.get(event)
        return None if point is None else self._network.index[point]

    def _nodes(self, branch: GameBranch) -> frozenset[int]:
        return self._shown[id(branch)]

    def _real(self) -> frozenset[int]:
        return frozenset[int]().union(*map(self._nodes, self.branches))


def find_strategy(
    plan: TeamPlan,
    *,
    human: Human = Human.RATIONAL,
    delay: Fraction = Fraction(0),
    solver: str = "z3",
    deadline: Deadline = NEVER,
    on_stage: Announce = unheard,
) -> Strategy:
    """A strategy for whatever people choose; if there is none, and people are rational, for what they choose then.

    Raises:
        RefutedError: if it is proved that there is none.
        UnsupportedError: if that could not be decided; it says why.
        OutOfTimeError: if the deadline passes.
        KeyboardInterrupt: if interrupted.
    """
    remedy = "robust pike check --controllable says why"
    for rational in (False, True) if human is Human.RATIONAL else (False,):
        rules = GameRules((), rational, delay or None)
        found = DecidingControllability(plan, rules, solver, deadline, on_stage).run()
        if found.strategy is not None:
            return found.strategy
        if deadline.passed:
            raise OutOfTimeError
        if found.status == Status.INTERRUPTED.value:
            raise KeyboardInterrupt
    if found.verdict is ControllabilityVerdict.UNCONTROLLABLE:
        raise RefutedError(f"--strategy: the plan is not controllable; {remedy}")
    raise UnsupportedError(f"--strategy: controllability is unknown; {remedy}")


@dataclass
class StrategyRehearsal(Rehearsal):
    """Executes a plan with a simulated team, as a strategy says; without one, it is found before the start."""

    _: KW_ONLY
    on_stage: Announce = unheard
    known_strategy: Strategy | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.patience = None  # waiting is part of the strategy

    def _deciding(self) -> Callable[[Progress], Reasoner]:
        """What follows the strategy.

        Raises:
            RefutedError: if there is no strategy.
            UnsupportedError: if it is not known whether there is one.
        """
        strategy = self.known_strategy or find_strategy(
            self.plan,
            human=self.story.human,
            delay=self.story.delay,
            solver=self.solver,
            deadline=self.deadline,
            on_stage=self.on_stage,
        )
        return partial(StrategyReasoner, strategy=strategy, solver=self.solver)

    @property
    def was_followed(self) -> bool:
        """Whether everything was as the strategy supposes, so far."""
        reasoner = self._executive.reasoner
        return isinstance(reasoner, StrategyReasoner) and reasoner.is_followed

    def _record(self, ending: Ending) -> ExecutionRecord:
        return replace(super()._record(ending), reasoner=STRATEGY)
