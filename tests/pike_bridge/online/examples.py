"""Plans with choices that admit a correct execution, moments of their executions, and reasoners that are compared."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random

from benchmarks.generators.team_plans import random_plan
from robust.errors import SolverError
from robust.pike import PlanExecutive, run_in_world
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.model import Activity, Event, Literal, TeamPlan, Tpnu, guard
from robust.pike_bridge.online.progress import Failed, Outcome
from robust.pike_bridge.online.semantic import Reasoner, SemanticReasoner
from robust.pike_bridge.online.world import Disturbance, Pace, SimulatedTeam, Story
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, Semantics, faults, holds
from robust.plan.model import Atom
from robust.smt.session import Satisfiability, Session
from tests.pike_bridge.brute_force import scenarios
from tests.pike_bridge.plans import random_plan as small_plan

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


def contested(number):
    """A small plan without much structure, each choice made at some event."""
    random = Random(number)  # noqa: S311 - reproducible
    plan = small_plan(random, events=8)
    guards = plan.network.guards

    def apart(name):
        return [event for event, label in guards.items() if name not in dict(label)] or [None]

    choices = tuple(replace(each, event=random.choice(apart(each.name))) for each in plan.network.choices)
    return replace(plan, network=replace(plan.network, choices=choices))


def tale(*disturbances, **outcomes):
    """Values of choices, whenever they are made, and what goes wrong."""
    return Story(outcomes={name: (value, None) for name, value in outcomes.items()}, disturbances=disturbances)


ANY, MUG = tale(), tale(xA1="mug")


def working(*constraints, choices=(), most=5):
    """Someone works from `begin` to `end`, for two or more; the event `own` is ours."""
    work = Activity("(work)", "begin", "end", Fraction(2), Fraction(most), agent="human")
    return TeamPlan(Tpnu("work", choices, tuple(map(Event, ("begin", "end", "own"))), constraints, (work,)), (), ())


def started(plan=None, reasoner=SemanticReasoner, *messages):
    """The kitchen after the first two moments: the human is about to choose a vessel."""
    executive = PlanExecutive(plan or kitchen(), reasoner)
    executive.step(Fraction(0))
    executive.step(Fraction(1, 1000))
    if messages:
        executive.step(Fraction(1, 1000), messages)
    return executive


def fetching():
    """The kitchen after the human has begun to fetch a mug."""
    executive = started(None, SemanticReasoner, Outcome("xA1", "mug"))
    while not executive.running:
        executive.step(executive.wake)
    return executive


def watch(executive, after=None, *, judge=None, story=ANY, seed=0, team=SimulatedTeam, **options):
    """Execute in a simulated world; `after` is told of each step: the executive, the time and the decisions."""
    decide = executive.step

    def step(now, messages=()):
        decisions = decide(now, messages)
        if after is not None:
            after(executive, now, decisions)
        return decisions

    executive.step = step
    world = team(executive.plan, executive, judge or executive.reasoner, story, seed=seed)
    run_in_world(executive, world, **options)
    return executive.outcome


class Hesitant(SimulatedTeam):
    """Makes every choice the same time after it is possible."""

    def _drawn(self, greatest):
        return greatest


def hesitate(plan, intent, delay, *, patience, after=None, pace=Pace.LEAST):
    """An executive after an execution with people who mean `intent`."""
    executive = PlanExecutive(plan, SemanticReasoner, patience=patience)
    told = Story(outcomes={name: (value, None) for name, value in intent.items()}, delay=delay, pace=pace)
    watch(executive, after, judge=SemanticReasoner(executive.progress), story=told, team=Hesitant)
    return executive


def exists(answer):
    return answer.verdict is ExecutionExistence.EXISTS


def possible(plan):
    return exists(Oracle(plan).decide())


def joint_values(plan):
    """What people may choose, all choices together."""
    yield from scenarios({each.name: each.domain for each in plan.network.choices if not each.controllable})


def confirming(plan, asked):
    """For `watch`: asks the oracle about each partial execution [PIKE, Theorem 4.7]; broken links are beyond it."""
    oracle = Oracle(plan)

    def confirm(executive, now, _decisions):
        progress = executive.progress
        if not progress.void:
            answer = oracle.decide(guard(progress.chosen), progress.times, now=progress.now)
            expected = ExecutionExistence.NONE if isinstance(executive.outcome, Failed) else ExecutionExistence.EXISTS
            assert answer.verdict is expected, (plan.name, now)
            asked.append(now)

    return confirm


def is_correct(plan, progress):
    """By the referee, whatever choices that were never made may be."""
    chosen = progress.chosen
    domains = {each.name: (chosen[each.name],) if each.name in chosen else each.domain for each in plan.network.choices}
    for scenario in scenarios(domains):
        activated = {name for name, label in plan.network.guards.items() if holds(label, scenario)}
        execution = Execution(scenario, progress.times)
        if activated == progress.times.keys() and not faults(plan, execution, reported=progress.reported):
            return True
    return False


class Continuations:
    """Whether something correct is left, by the definition of correct executions alone [PIKE, Definition 2.8]."""

    def __init__(self, plan, semantics=None):
        self._plan, self._semantics = plan, semantics or Semantics(plan)
        self._session = Session(self._semantics.terms)
        self._session.add(*self._semantics.formulas)
        self._observed = {each.name for each in plan.network.choices if not each.controllable}

    def possible(self, intent, chosen, times, now, *, others=True):
        """Whether a correct execution has the intent, and what was chosen and executed.

        It has the rest now or later, and what is for others to do, if there are others, after now.
        """
        semantics, network = self._semantics, self._plan.network
        if any(chosen.get(name, value) != value for name, value in intent.items()):
            return False
        asked = [semantics.guard(guard(intent)), semantics.guard(guard(chosen))]
        late = now + self._plan.epsilon
        for event, label in network.guards.items():
            if event in times:
                asked += [semantics.guard(label), semantics.at(event, times[event])]
                continue
            asked.append(semantics.not_earlier(event, now))
            choices = {each.name for each in network.choices if each.event == event} | set(dict(label))
            if others and choices & self._observed - chosen.keys():
                asked.append(semantics.not_earlier(event, late))
            ending = [each for each in network.activities if others and each.target == event]
            asked += [semantics.not_earlier(event, late, activity.guard) for activity in ending]
        with self._session.frame(*asked):
            return self._session.check("an intent") is Satisfiability.SATISFIABLE


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
    continuations = Continuations(plan, Seen(plan, progress.times, progress.reported))
    return continuations.possible({}, progress.chosen, progress.times, progress.now, others=False)


def check_against_definition(executive):
    """A correct execution is left by the definition, unless the executive has said that there is none."""
    plan, progress, name = executive.plan, executive.progress, type(executive.outcome).__name__
    assert is_correct(plan, progress) if name == "Succeeded" else is_left(plan, progress) == (name != "Failed"), (
        plan.name
    )


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
            asked = f"{question} {about[:-1]} at {self.progress.now}?"
            raise SolverError(f"{asked} {self.name}: {ours}, {self.companion.name}: {theirs}")
        return ours
