"""Plans with choices that admit a correct execution, moments of their executions, and reasoners that are compared."""

from fractions import Fraction
from functools import cache
from itertools import product
from pathlib import Path

from benchmarks.generators.team_plans import random_plan
from robust.errors import SolverError
from robust.execute.drive import run_in_world
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.model import Activity, Event, Literal, TeamPlan, Tpnu, guard
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Failed, Outcome
from robust.pike_bridge.online.semantic import Reasoner, SemanticReasoner
from robust.pike_bridge.online.world import Disturbance, SimulatedTeam, Story
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, Semantics, faults, holds
from robust.plan.model import Atom
from robust.smt.session import Satisfiability, Session

KITCHEN = Path(__file__).parents[3] / "robust" / "examples" / "kitchen" / "kitchen.tpnu.json"
SOLVABLE = (0, 4, 5, 16, 17, 19, 26, 34, 42, 53, 70, 71, 83, 87, 92, 94, 103, 108, 119, 121)
"""Of the random plans of seed 0."""
TOASTER = Atom("working", ("toaster",))
BROKEN = Disturbance(Fraction(1), Literal(TOASTER, False))


@cache
def kitchen():
    return load_team_plan(KITCHEN)


@cache
def drawn(index):
    return random_plan(0, index).plan()


def tale(*disturbances, **outcomes):
    """Values of choices, whenever they are made, and what goes wrong."""
    return Story(outcomes={name: (value, None) for name, value in outcomes.items()}, disturbances=disturbances)


ANY = tale()
MUG = tale(xA1="mug")


def working(*constraints, choices=(), most=5):
    """Someone works from `begin` to `end`, for two or more; the event `own` is ours."""
    events = tuple(Event(name) for name in ("begin", "end", "own"))
    work = Activity("(work)", "begin", "end", Fraction(2), Fraction(most), agent="human")
    return TeamPlan(Tpnu("work", choices, events, constraints, (work,)), (), ())


def started(plan=None, reasoner=SemanticReasoner):
    """The kitchen after the first two moments: the human is about to choose a vessel."""
    executive = PlanExecutive(plan or kitchen(), reasoner)
    executive.step(Fraction(0))
    executive.step(Fraction(1, 1000))
    return executive


def fetching():
    """The kitchen after the human has begun to fetch a mug."""
    executive = started()
    executive.step(Fraction(1, 1000), [Outcome("xA1", "mug")])
    while not executive.running:
        executive.step(executive.wake)
    return executive


def watch(executive, after, *, judge=None, story=ANY, seed=0, horizon=None):
    """Execute in a simulated world; `after` is told of each step: the executive, the time and the decisions."""
    decide = executive.step

    def step(now, messages=()):
        found = decide(now, messages)
        after(executive, now, found)
        return found

    executive.step = step
    team = SimulatedTeam(executive.plan, executive, judge or executive.reasoner, story, seed=seed)
    run_in_world(executive, team, **({} if horizon is None else {"horizon": horizon}))
    return executive.outcome


def confirming(plan, asked):
    """For `watch`: asks the oracle about each partial execution [PIKE, Theorem 4.7]; broken links are beyond it."""
    oracle = Oracle(plan)

    def confirm(executive, now, _found):
        progress = executive.progress
        if not progress.void:
            answer = oracle.decide(guard(progress.chosen), progress.times, now=progress.now)
            expected = ExecutionExistence.NONE if isinstance(executive.outcome, Failed) else ExecutionExistence.EXISTS
            assert answer.verdict is expected, (plan.name, now)
            asked.append(now)

    return confirm


def is_correct(plan, progress):
    """By the referee, whatever choices that were never made may be."""
    domains = (
        [progress.chosen[each.name]] if each.name in progress.chosen else each.domain for each in plan.network.choices
    )
    for values in product(*domains):
        scenario = dict(zip((each.name for each in plan.network.choices), values, strict=True))
        activated = {name for name, label in plan.network.guards.items() if holds(label, scenario)}
        if activated == progress.times.keys():
            execution = Execution(scenario, progress.times)
            if not faults(plan, execution, reported=progress.reported):
                return True
    return False


class Seen(Semantics):
    """Correct executions, where an event was before a report if it is at an earlier time, by however little."""

    def __init__(self, plan, times, reported):
        self._seen, self._reported = times, reported
        super().__init__(plan)

    def _before(self, earlier, later):
        times = self._seen
        observed = later in self._reported and earlier in times and times[earlier] < times[later]
        return self.terms.true if observed else super()._before(earlier, later)


def is_left(plan, progress):
    """Whether a correct execution agrees with what has happened, and has the rest now or later."""
    semantics = Seen(plan, progress.times, progress.reported)
    session = Session(semantics.terms)
    session.add(*semantics.formulas, semantics.guard(guard(progress.chosen)))
    for event, label in plan.network.guards.items():
        if event in progress.times:
            session.add(semantics.guard(label), semantics.at(event, progress.times[event]))
        else:
            session.add(semantics.not_earlier(event, progress.now))
    return session.check("what is left") is Satisfiability.SATISFIABLE


class Compared(Reasoner):
    """Each question goes to both; the companion knows better.

    Questions raise SolverError if the answers differ.
    """

    def __init__(self, deciding, companion):
        super().__init__(deciding.progress)
        self.name, self.deciding, self.companion = deciding.name, deciding, companion

    def _learn(self, news):
        raise AssertionError

    def executable(self, event, deadline):
        return self._same("executable", event, deadline)

    def could(self, environment, deadline):
        return self._same("could", environment, deadline)

    def next_time(self, deadline):
        """The earlier of both; the companion's is exact, and no other may be later."""
        ours, theirs = self.deciding.next_time(deadline), self.companion.next_time(deadline)
        if theirs is not None and (ours is None or ours > theirs):
            raise SolverError(f"{self.name} would look again at {ours}, {self.companion.name} at {theirs}")
        return ours

    def _same(self, question, *about):
        ours, theirs = (getattr(each, question)(*about) for each in (self.deciding, self.companion))
        if ours != theirs:
            found = f"{question} {about[:-1]} at {self.progress.now}?"
            raise SolverError(f"{found} {self.name}: {ours}, {self.companion.name}: {theirs}")
        return ours
