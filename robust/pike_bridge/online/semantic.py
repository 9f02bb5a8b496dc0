"""What an executive asks of its reasoning [PIKE, Algorithms 1 to 3], and `smt`: answers from the oracle's formula.

All reasoners mean the same by them. A *continuation* is a correct execution that agrees with all that has happened, and
in which every pending event has the present time or a later one. An event is *executable* now if some continuation
executes it now, in which whatever is not the executive's to execute comes later: what is not reported has not happened.
Times are on the grid that the plan's bounds and its ε are on; "strictly before" is by ε at least.

The semantic reasoner compiles nothing: one incremental solver is told what happens as it happens. It uses no labeled
shortest paths, no causal links and no knowledge base, so that it is also what executives with those are held against.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Set
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import islice
from math import ceil, floor

from robust.pike_bridge.knowledge.sat import satisfiable
from robust.pike_bridge.model import ALWAYS, Condition, Constraint, Effect, Guard, guard
from robust.pike_bridge.online.continuations import Alike, Continuation
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.semantics import Execution, Semantics, Time, holds
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline
from robust.smt.session import Formula, Session, Terms


@dataclass(frozen=True, slots=True)
class News:
    """What has happened since a reasoner was asked last."""

    chosen: Guard
    """Choices that were made or observed."""
    times: Mapping[str, Fraction]
    """Events that were executed, in their order."""
    void: Set[tuple[Effect, Condition]]
    """Effects that do not support conditions any more [PIKE §3, CheckActivatedCausalLinks]."""
    later: bool
    """Whether time has passed: windows may be missed [PIKE, Algorithm 1, line 6]."""


class Reasoner(ABC):
    """Answers about one execution. Its facts are in `progress`, where they only grow; each question looks for new ones.

    Questions raise OutOfTimeError if their deadline passes, and change nothing then.
    """

    name: str

    def __init__(self, progress: Progress) -> None:
        self.progress = progress
        self._seen: tuple[int, int, Set[tuple[Effect, Condition]], Fraction | None] = (0, 0, frozenset(), None)
        """How many choices and events are known, which broken links, and the time."""

    def catch_up(self) -> None:
        """Learn what has happened; questions begin with it."""
        progress, seen = self.progress, self._seen
        self._seen = (len(progress.chosen), len(progress.times), frozenset(progress.void), progress.now)
        if self._seen != seen:
            choices, events, void, now = seen
            chosen = guard(dict(islice(progress.chosen.items(), choices, None)))
            times = dict(islice(progress.times.items(), events, None))
            self._learn(News(chosen, times, progress.void - void, progress.now != now))

    @property
    def view(self) -> "SemanticReasoner | None":
        """The semantic reasoning about what is under way, after :meth:`catch_up`; None if it asks something else."""
        return None

    def under_way(self) -> "SemanticReasoner":
        """The view, which knows all that has happened; of reasoners that have one."""
        self.catch_up()
        assert self.view is not None  # noqa: S101 - others are not asked
        return self.view

    @property
    def known(self) -> Continuation | None:
        """A continuation that was found, after :meth:`catch_up`; None if none is known. Choices that do not matter may
        be missing from it.
        """
        return None if self.view is None else self.view.known

    def not_before(self) -> Fraction | None:
        """A time that :meth:`next_time` is not before, without asking anything; None: it is never."""
        self.catch_up()
        return self._opening(self.progress.now) if self.view is None else self.view.not_before()

    def due(self) -> tuple[str, Mapping[str, str]] | None:
        """An event that a known continuation executes now, where waiting might leave none, and its choices."""
        self.catch_up()
        return None if self.view is None else self.view.due()

    def meaning(self, values: Guard) -> list[Guard]:
        """What people may mean by values in the view, where a value there may stand for several."""
        return [values]

    @abstractmethod
    def _learn(self, news: News) -> None:
        """Take note of what has happened."""

    def begin(self) -> None:  # noqa: B027 - most have nothing to do
        """Prepare for questions, which no budget counts."""

    def possible(self, deadline: Deadline) -> bool:
        """CorrectTeamPlanExists?: whether there is a continuation."""
        return self.could(ALWAYS, deadline)

    @abstractmethod
    def executable(self, event: str, deadline: Deadline) -> bool:
        """CanExecuteEventNow? [PIKE, Algorithm 2]."""

    @abstractmethod
    def could(self, environment: Guard, deadline: Deadline) -> bool:
        """Whether there is a continuation in the environment."""

    @abstractmethod
    def next_time(self, deadline: Deadline) -> Fraction | None:
        """A time from which on more may be executable or lost, though nothing happens before; None: never."""

    def _candidates(self, withheld: Collection[str] = ()) -> list[str]:
        """Events that may be executable without a message."""
        progress = self.progress
        known = (event for event in progress.frontier if event not in withheld and progress.ours(event))
        return [event for event in known if not progress.awaits(event)]

    def _opening(self, moment: Fraction) -> Fraction:
        """When to look again if something is executable from a moment on."""
        grid = self.progress.grid
        return max(self.progress.now + grid, floor(moment / grid) * grid)

    def _closing(self, moment: Fraction) -> Fraction:
        """When to look again if nothing is possible after a moment."""
        grid = self.progress.grid
        return ceil(moment / grid) * grid + grid


_FIRST = "first time"
_BISECTION = 3
"""The number of improvements after which the rest of the interval is bisected."""


class OnlineSemantics(Semantics):
    """The semantics of executions in which links can break."""

    def __init__(self, progress: Progress, terms: Terms | None = None) -> None:
        self._progress = progress
        self._void: dict[tuple[Effect, Condition], Formula] = {}
        super().__init__(progress.plan, terms, epsilon=progress.plan.separation)

    def ours(self, event: str) -> Formula:
        """The formula that the event is activated, and the executive's to execute."""
        theirs = (self.terms.negation(self.guard(label)) for label in self._progress.external(event))
        return self.terms.conjunction((self.guard(self._progress.structure.guards[event]), *theirs))

    def later(self, event: str, moment: Time) -> Formula:
        """The formula that the event, if it is activated, is after a moment."""
        guard = self._progress.structure.guards[event]
        return self.unless(guard, self.terms.greater(self.time_of(event) - moment))

    def not_ours_before(self, event: str, moment: Time) -> list[Formula]:
        """The formula that the event, wherever it is not the executive's to execute, is at a moment or later."""
        return [self.not_earlier(event, moment, label) for label in self._progress.external(event)]

    def continuation(self, session: Session) -> Continuation:
        """The solver's model; what is known already is not read from it again, because reading takes long."""
        progress = self._progress
        scenario = self.chosen(session.values(self.choices)) | progress.chosen
        coming = [name for name in progress.pending if holds(progress.structure.guards[name], scenario)]
        values = session.values(self.times(coming))
        found = Execution(scenario, {**progress.times, **{name: self.time(name, values) for name in coming}})
        return Continuation(scenario, found.schedule, Alike(progress, found, self._orders))

    def _before(self, earlier: str, later: str) -> Formula:
        return self.terms.true if self._progress.settled(earlier, later) else super()._before(earlier, later)

    def void(self, effect: Effect, condition: Condition) -> Formula:
        """The formula that the effect does not support the condition."""
        return self._void.get((effect, condition), self.terms.true)

    def _support(self, producer: Effect, threats: list[Effect], condition: Condition) -> Formula:
        broken = self._void[producer, condition] = self.terms.fresh_boolean(f"broken {len(self._void)} ")
        intact = self.terms.negation(broken)
        return self.terms.conjunction((intact, super()._support(producer, threats, condition)))


class SemanticReasoner(Reasoner):
    """Asks one solver session, which knows all that has happened by now, what no known continuation answers.

    Args:
        terms: where formulas are built; reasoners about plans that are much alike are made faster if they share them.

    Raises:
        SolverError: if the solver is unknown or not installed.
    """

    name = "smt"

    def __init__(self, progress: Progress, *, solver: str = "z3", terms: Terms | None = None) -> None:
        super().__init__(progress)
        self._witness: Continuation | None = None
        """A continuation, if one is known; choices that do not matter may be missing from it."""
        self._terms = terms or Terms()
        self._solver = solver
        self._epsilon = progress.plan.separation
        self._grid = progress.grid
        self._first = Polynomial.variable(_FIRST)
        self._later: tuple[object, list[Formula]] = (None, [])
        """What was said last of events that are not the executive's to execute, and at which moment."""

    @cached_property
    def semantics(self) -> OnlineSemantics:
        """What formulas say, from the first question on: whoever repeats what was decided asks none."""
        return OnlineSemantics(self.progress, self._terms)

    @cached_property
    def _session(self) -> Session:
        # Proving is quicker here for what has a model as well: the median of many small questions halves.
        session = Session(self._terms, solver=self._solver, proving=True)
        session.add(*self.semantics.formulas)
        return session

    def begin(self) -> None:
        self._session.add()  # nothing beyond what it begins with

    def _learn(self, news: News) -> None:
        witness, now = self._witness, self.progress.now
        if witness is not None:
            lasting = not news.void and holds(news.chosen, witness.scenario) and not self.progress.close(news.times)
            if not lasting:
                self._witness = None
            elif any(witness.schedule.get(event) != time for event, time in news.times.items()) or (
                news.later and any(time < now for _, time in self._ahead(witness))
            ):
                self._witness = witness.retimed(late=True) or witness.retimed()
        if self.progress.close(news.times):  # what was open about their order is known now
            vars(self).pop("semantics", None)
            vars(self).pop("_session", None)
            everything = guard(self.progress.chosen)
            news = News(everything, dict(self.progress.times), set(self.progress.void), later=True)
        semantics, guards = self.semantics, self.progress.structure.guards
        self._session.add(semantics.guard(news.chosen), *(semantics.void(*link) for link in news.void))
        for event, time in news.times.items():
            self._session.add(semantics.guard(guards[event]), semantics.at(event, time))
        if news.later:  # no pending event is in the past; it is enough to say so of the frontier
            self._session.add(*self._from(now, ALWAYS))

    def executable(self, event: str, deadline: Deadline) -> bool:
        self.catch_up()
        now, ours = self.progress.now, self.semantics.ours(event)
        if self._executes_at(event, now) or ours is self._terms.false:
            return ours is not self._terms.false
        return self._ask([ours, self.semantics.at(event, now), *self._unreported()], deadline)

    @property
    def view(self) -> "SemanticReasoner":
        """All is under way."""
        return self

    @property
    def known(self) -> Continuation | None:
        return self._witness

    def not_before(self) -> Fraction | None:
        self.catch_up()
        candidates = self._candidates()
        if candidates:
            return self._opening(min(self.progress.earliest(event) or self.progress.now for event in candidates))
        if self._witness is None:
            return self._opening(self.progress.now)
        last = self._witness.latest(self.progress.frontier)
        return None if last is None else self._closing(last)

    def due(self) -> tuple[str, Mapping[str, str]] | None:
        self.catch_up()
        witness, now, frontier = self._witness, self.progress.now, list(self.progress.frontier)
        if witness is None:
            return None
        last = witness.latest(frontier)
        if last is None or last > now + self._grid:
            return None
        acts = (e for e in frontier if witness.ours(e) and self._executes_at(e, now))
        event = next(acts, None)
        return None if event is None else (event, witness.scenario)

    def could(self, environment: Guard, deadline: Deadline, more: Collection[Constraint] = ()) -> bool:
        """Whether there is a continuation in the environment which meets some more constraints."""
        self.catch_up()
        if self._witness is not None and not more and holds(environment, self._witness.scenario):
            return True
        asked = [self.semantics.guard(environment), *map(self.semantics.constraint, more)]
        return self.progress.compatible(environment) and self._ask(asked, deadline)

    def next_time(self, deadline: Deadline) -> Fraction | None:
        """When something is executable first; if nothing is without a message, when it is too late for any."""
        opening = self.next_execution((), deadline)
        if opening is not None:
            return opening
        last = self.quiet_until(deadline)
        return None if last is None else self._closing(last)

    def allows(self, moment: Fraction, environment: Guard, event: str | None, deadline: Deadline) -> bool:
        """Whether some continuation in the environment has nothing before a moment, and then the event, if given."""
        self.catch_up()
        then = [] if event is None else [self.semantics.at(event, moment)]
        with self._session.frame(*self._from(moment, environment), *then):
            return self._check(deadline)

    def times_of(
        self, event: str, moment: Fraction, deadline: Deadline, *, first: bool = False
    ) -> tuple[Fraction, Fraction | None] | None:
        """The least and the greatest time (None: any later one) that a pending event has in continuations which have
        nothing before a moment; None if there is none that has the event.

        If `first`, only continuations count in which nothing is before the event.
        """
        self.catch_up()
        guard = self.progress.structure.guards[event]
        same = [self._terms.equal(self.semantics.time_of(event) - self._first)]
        same += self._from(self._first, ALWAYS) if first else ()
        with self._session.frame(*same, *self._from(moment, guard)):
            least = self._best(moment, deadline, sign=1)
            if least is None:
                return None
            horizon = self._horizon()
            greatest = self._best(horizon, deadline, sign=-1)
        return least, None if greatest == horizon else greatest

    def soonest(self, event: str, environment: Guard, deadline: Deadline, *, late: bool) -> Fraction | None:
        """The least time of an event in continuations in an environment; None if there are none.

        If `late`, what is not the executive's to execute comes after now in them.
        """
        self.catch_up()
        same = self._terms.equal(self.semantics.time_of(event) - self._first)
        with self._session.frame(self.semantics.guard(environment), same, *(self._unreported() if late else ())):
            return self._best(self.progress.now, deadline, sign=1)

    # -- patience ----------------------------------------------------------------------------------------------------

    def continuation(self, environment: Guard, event: str | None, deadline: Deadline) -> Continuation | None:
        """A continuation in the environment in which what is not the executive's to execute comes after now.

        The event, if given, is executed by the executive now.
        """
        self.catch_up()
        if not self.progress.compatible(environment):
            return None
        asked = [self.semantics.guard(environment), *self._unreported()]
        if event is not None:
            asked += [self.semantics.ours(event), self.semantics.at(event, self.progress.now)]
        if not self._ask(asked, deadline):
            return None
        # At the least times as much as possible is done now.
        self._witness = (self._witness and self._witness.retimed(late=True)) or self._witness
        return self._witness

    def coming_before(self, events: Iterable[str], others: Collection[str], deadline: Deadline) -> set[str]:
        """The events that may happen before each of the others: in some continuation they do, or they do now.

        Now they may happen before what happens at the same moment, unless the plan puts that first.
        """
        self.catch_up()
        structure, semantics = self.progress.structure, self.semantics
        coming: set[str] = set()
        for event in events:
            if not structure.preceding(event).isdisjoint(others):
                continue
            time, activated = semantics.time_of(event), semantics.guard(structure.guards[event])
            for then in ([semantics.later(other, time) for other in others], [semantics.at(event, self.progress.now)]):
                with self._session.frame(activated, *then):
                    if self._check(deadline):
                        coming.add(event)
                        break
        return coming

    def all_later(
        self, environment: Guard, events: Iterable[str], moment: Fraction, deadline: Deadline, *, beyond: bool = True
    ) -> Continuation | None:
        """A continuation in the environment that has those of the events that it has after a moment, or, unless
        `beyond`, not before it; None without.
        """
        self.catch_up()
        comes = self.semantics.later if beyond else self.semantics.not_earlier
        later = (comes(event, moment) for event in sorted(events))
        return self._witness if self._ask([self.semantics.guard(environment), *later], deadline) else None

    def latest(self, environment: Guard, events: Collection[str], deadline: Deadline) -> Fraction | None:
        """The greatest time before which none of the events need be executed in some continuation in the environment.

        None if there is none, or no such continuation.
        """
        latest: Fraction | None = self.progress.now
        continuation = self._witness if self.could(environment, deadline) else None
        while continuation is not None:
            latest = continuation.latest(events)
            continuation = None if latest is None else self.all_later(environment, events, latest, deadline)
        return latest

    def next_execution(self, withheld: Collection[str], deadline: Deadline) -> Fraction | None:
        """A time from which on an event is executable that is not withheld; None: never without a message."""
        self.catch_up()
        earliest = self._earliest_execution(deadline, withheld)
        return None if earliest is None else self._opening(earliest)

    def _from(self, moment: Time, environment: Guard) -> Iterator[Formula]:
        yield self.semantics.guard(environment)
        for event in self.progress.frontier:
            yield self.semantics.not_earlier(event, moment)

    def _executes_at(self, event: str, moment: Fraction) -> bool:
        """Whether the witness shows that an event would be executable at a moment, if it has nothing before."""
        witness, progress = self._witness, self.progress
        if witness is None or witness.schedule.get(event) != moment:
            return False
        later = moment + progress.plan.separation
        return not any(time < moment or not witness.ours(name) for name, time in self._ahead(witness) if time < later)

    def _ahead(self, witness: Continuation) -> list[tuple[str, Fraction]]:
        return [(name, time) for name, time in witness.schedule.items() if name in self.progress.pending]

    def _ask(self, hypothesis: Iterable[Formula], deadline: Deadline) -> bool:
        with self._session.frame(*hypothesis):
            if not self._check(deadline):
                return False
            self._witness = self.semantics.continuation(self._session)
            return True

    def _check(self, deadline: Deadline) -> bool:
        return satisfiable(self._session, "a continuation", deadline)

    def _unreported(self) -> list[Formula]:
        """The formula that what is not the executive's to execute is later than now; the same for many questions."""
        progress = self.progress
        moment = (progress.now, len(progress.times), len(progress.chosen))
        if self._later[0] != moment:
            self._later = (moment, list(self._externals_after(progress.now)))
        return self._later[1]

    def _externals_after(self, moment: Time) -> Iterator[Formula]:
        """Formulas: what is not the executive's to execute is later than a moment before which nothing pending is."""
        pending, before = self.progress.pending, self.progress.structure.before
        for event in pending:
            if not any(earlier in pending for earlier in before[event]):
                yield from self.semantics.not_ours_before(event, moment + self._epsilon)

    def _earliest_execution(self, deadline: Deadline, withheld: Collection[str] = ()) -> Fraction | None:
        """The least time after now at which an event is executable if nothing happens before."""
        progress = self.progress
        candidates = self._candidates(withheld)
        if not candidates:
            return None
        soonest = progress.now + progress.grid
        first = max(soonest, min(progress.earliest(event) or soonest for event in candidates))
        if any(self._executes_at(event, first) for event in candidates):
            return first
        hypothesis = [
            self._terms.disjunction(
                self._terms.conjunction(
                    (self.semantics.ours(event), self._terms.equal(self.semantics.time_of(event) - self._first))
                )
                for event in candidates
            ),
            *self._from(self._first, ALWAYS),
            *self._externals_after(self._first),
            self._terms.at_least(self._first - first),
        ]
        with self._session.frame(*hypothesis):
            return self._best(first, deadline, sign=1)

    def quiet_until(self, deadline: Deadline) -> Fraction | None:
        """The greatest time before which nothing need be executed; None if nothing ever need, or nothing is correct."""
        return self.latest(ALWAYS, list(self.progress.frontier), deadline) if self.possible(deadline) else None

    def _horizon(self) -> Fraction:
        """A time that no bound reaches which is made of the plan's numbers and the times so far."""
        bounds = map(abs, self.progress.plan.network.bounds)
        return self.progress.now + sum(bounds, self._epsilon * (len(self.progress.times) + 2))

    def _best(self, bound: Fraction, deadline: Deadline, sign: int) -> Fraction | None:
        """The least value (sign 1) or the greatest (sign −1) of the first time, none being beyond the bound in the end.

        None if there is no value at all.
        """
        with self._session.frame(self._terms.equal(self._first - bound)):
            if self._check(deadline):
                return bound
        if not self._check(deadline):
            return None
        best = self._on_grid(self._value(), sign)
        improvements = 0
        while sign * (best - bound) > self._grid:
            improvements += 1
            aim = best - sign * self._grid
            if improvements > _BISECTION:
                aim = self._on_grid((best + bound) / 2, sign)
            with self._session.frame(self._terms.at_least((self._first - aim).scaled(-sign))):
                if self._check(deadline):
                    best = self._on_grid(self._value(), sign)
                elif improvements > _BISECTION:
                    bound = aim
                else:
                    break
        return best

    def _value(self) -> Fraction:
        values = self._session.values([self._terms.real(_FIRST)])
        return Fraction(values[_FIRST])

    def _on_grid(self, time: Fraction, sign: int) -> Fraction:
        """The nearest time on the grid towards the bound, which is possible if the time is: bounds are on the grid."""
        return (floor if sign > 0 else ceil)(time / self._grid) * self._grid
