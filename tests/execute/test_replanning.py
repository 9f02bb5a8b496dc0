"""Runs with re-planning: the problem that is left, planners that help or do not, and the judge's last word."""

import asyncio
from dataclasses import dataclass, field, replace
from fractions import Fraction

import pytest

from robust.errors import InputError, UnsupportedError
from robust.execute import replan
from robust.execute.dispatch.dispatcher import Dispatcher, LeftBox, Rejected
from robust.execute.dispatch.network import Blex
from robust.execute.drive import drive, run_in_world
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.execute.worlds.rules import Luck, Rule, Rules, Subject
from robust.execute.worlds.world import Outcome, Setting, SimulatedWorld
from robust.plan.model import Atom, Fluent, TimedLiteral
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.timed import parse_timed_plan
from robust.plan.timeline import State
from robust.qe.box import Box, Interval
from tests.execute.execution import DOMAIN, PLANS, PROBLEM, constant, tasks, with_box

F = Fraction
EPSILON = F(1, 1000)
# One thing at a time.
SERIAL = (
    DOMAIN.replace("(at start (ready ?t))", "(at start (ready ?t)) (at start (free))")
    .replace("(at start (not (ready ?t)))", "(at start (not (ready ?t))) (at start (not (free))) (at end (free))")
    .replace("(at start (>= (stock) (need ?t)))", "(and (at start (>= (stock) (need ?t))) (at start (free)))")
)
FREE = PROBLEM.replace("(:init", "(:init (free)")
DOMAIN_READ = parse_domain(SERIAL)
PROBLEM_READ = parse_problem(FREE, DOMAIN_READ)
FIRST = "0: (work a) [10]\n10.001: (fetch b) [2]\n12.002: (work b) [6]\n"
SPECS = parse_specs(["duration:work", "need=fluent:(need b)"])


@dataclass
class Scripted:
    """Answers with plans for what is still to be done, and remembers the problems."""

    name: str = "scripted"
    problems: list = field(default_factory=list)
    silent_after: int = 99
    error: Exception | None = None

    def solve(self, domain, problem, deadline):
        assert deadline.remaining <= 7
        self.problems.append(problem)
        if self.error is not None:
            raise self.error
        if len(self.problems) > self.silent_after:
            return PlannerAnswer(self.name, PlannerStatus.NO_PLAN, None, 0.1, "nothing to be found")
        lines, time = [], F(0)
        for task in "ab":
            if Atom("done", (task,)) in problem.atoms:
                continue
            if Atom("ready", (task,)) not in problem.atoms:
                lines.append(f"{time}: (fetch {task}) [2]")
                time += 2 + EPSILON
            lines.append(f"{time}: (work {task}) [6]")
            time += 6 + EPSILON
        return PlannerAnswer(self.name, PlannerStatus.SOLVED, parse_timed_plan("\n".join(lines)), 0.1)


LATE = constant(Subject.DURATION, "(work a)", 45)


def mission(*rules, planner=None, specs=SPECS, **more):
    return replan.Mission(DOMAIN_READ, PROBLEM_READ, planner, Rules(rules), options=replan.Options(specs=specs), **more)


def prepared(chosen):
    return replan.prepare_timed(DOMAIN_READ, PROBLEM_READ, parse_timed_plan(FIRST), chosen.options)


def ran(*rules, **more):
    """The run of a mission."""
    chosen = mission(*rules, **more)
    return replan.execute(chosen, 0, prepared(chosen))


# -- the problem that is left ------------------------------------------------------------------------------------------


def test_the_state_reached_is_the_new_initial_state():
    state = State(frozenset({Atom("done", ("a",)), Atom("open")}), {Fluent("stock"): F(7)})
    left = replan.remaining_problem(PROBLEM_READ, state, F(25))
    assert left.atoms == state.atoms
    assert left.fluents == {Fluent("stock"): 7}
    assert [(one.time, one.value) for one in left.timed_literals] == [(35, False)]
    assert left.goal == PROBLEM_READ.goal
    assert replan.remaining_problem(PROBLEM_READ, state, F(60)).timed_literals == ()


def test_the_next_plan_begins_after_what_has_just_happened():
    literals = [TimedLiteral(F(5), Atom("open"), True), TimedLiteral(F(5) + EPSILON / 2, Atom("open"), False)]
    assert replan.origin_after(F(3), literals, EPSILON) == 3 + EPSILON
    assert replan.origin_after(F(5) - EPSILON / 2, literals, EPSILON) == 5 + EPSILON + EPSILON / 2
    assert replan.origin_after(F(5) - EPSILON, literals, EPSILON) == 5 + EPSILON + EPSILON / 2


# -- runs --------------------------------------------------------------------------------------------------------------


def test_a_run_without_surprises_succeeds_without_asking_anybody():
    run = ran()
    assert (run.status, run.reason, run.replans, run.inside) == (replan.RunStatus.SUCCEEDED, "", 0, True)
    assert run.end == 18 + 2 * EPSILON


def test_a_run_re_plans_from_the_state_reached():
    planner = Scripted()
    run = ran(LATE, planner=planner)
    assert (run.status, run.reason, run.replans, run.inside) == (replan.RunStatus.SUCCEEDED, "", 1, False)
    first, second = run.segments
    assert isinstance(first.ending, LeftBox)
    assert first.given_up < 45
    assert [one.outcome for one in first.executed] == [Outcome.DONE]
    assert (first.end, second.start) == (45, 45 + EPSILON)
    (problem,) = planner.problems
    assert Atom("done", ("a",)) in problem.atoms
    assert [one.time for one in problem.timed_literals] == [15 - EPSILON]
    assert [one.instance.action for one in second.executed] == ["fetch", "work"]
    assert second.executed[0].start == 45 + EPSILON
    assert all(one.time >= second.start for one in second.observations)


def test_planning_may_take_time_in_the_world():
    planner = Scripted()
    run = ran(LATE, planner=planner, planning_time=F(3))
    assert run.segments[1].start == 48 + EPSILON
    assert [one.time for one in planner.problems[0].timed_literals] == [12 - EPSILON]


def test_running_actions_may_be_stopped():
    planner = Scripted(silent_after=0)
    (segment,) = ran(LATE, planner=planner, drain=False).segments
    assert [one.outcome for one in segment.executed] == [Outcome.STOPPED]
    assert segment.executed[0].end == segment.given_up < 45
    assert Atom("ready", ("a",)) not in planner.problems[0].atoms  # its effect at the start has happened
    assert Atom("done", ("a",)) not in planner.problems[0].atoms  # that at the end has not


def test_a_plan_that_is_given_up_when_all_is_done_has_succeeded():
    """The last action takes longer than the executor accepts; it is waited for, and there is nothing left to plan."""
    planner = Scripted()
    chosen = mission(constant(Subject.DURATION, "(work b)", 9), planner=planner)
    chosen = replace(chosen, options=replace(chosen.options, executor=Blex(F(1, 10))))
    run = replan.execute(chosen, 0, prepared(chosen))
    assert (run.status, run.reason, run.replans, planner.problems) == (replan.RunStatus.SUCCEEDED, "", 0, [])
    assert (run.inside, run.segments[-1].executed[-1].outcome) == (False, Outcome.DONE)
    stopped = replan.execute(replace(chosen, drain=False), 0, prepared(chosen))
    assert (len(planner.problems), stopped.segments[0].executed[-1].outcome) == (1, Outcome.STOPPED)
    late = replan.execute(
        replace(chosen, rules=Rules((constant(Subject.DURATION, "(work b)", 90),))), 0, prepared(chosen)
    )
    assert late.status is replan.RunStatus.FAILED  # what has to hold during the action does not


def test_a_planner_that_finds_nothing_ends_the_run():
    run = ran(LATE, planner=Scripted(silent_after=0))
    assert run.status is replan.RunStatus.FAILED
    assert run.reason.endswith("; scripted: no plan: nothing to be found")
    assert ran(LATE).reason.endswith("there is no planner to ask for another plan")


def test_a_planner_that_cannot_read_the_problem_ends_the_run():
    chosen = mission(LATE, planner=Scripted(error=UnsupportedError("no numbers")))
    assert replan.execute(chosen, 0, prepared(chosen)).reason.endswith("; no numbers")
    with pytest.raises(replan.NoPlanError, match="no numbers"):
        replan.first_plan(chosen)


def test_an_invalid_plan_is_not_executed():
    class Wrong(Scripted):
        def solve(self, domain, problem, deadline):
            return PlannerAnswer("wrong", PlannerStatus.SOLVED, parse_timed_plan("0: (work b) [6]"), 0.1)

    with pytest.raises(replan.NoPlanError, match="invalid plan"):
        replan.first_plan(mission(planner=Wrong()))


def test_re_plans_are_counted_and_limited():
    class Forgetful(Scripted):
        """Nature is never as this one expects."""

        def solve(self, domain, problem, deadline):
            self.problems.append(problem)
            return PlannerAnswer(
                "f", PlannerStatus.SOLVED, parse_timed_plan("0: (fetch b) [2]\n2.001: (work b) [6]"), 0.1
            )

    text = FREE.replace("(and (done a) (done b))", "(done b)").replace("(= (stock) 10)", "(= (stock) 1000)")
    problem = parse_problem(text.replace("(at 60 (not (open)))", ""), DOMAIN_READ)
    chosen = replace(
        mission(constant(Subject.DURATION, "fetch", 3), planner=Forgetful(), replans=4, specs=()), problem=problem
    )
    run = replan.execute(chosen, 0)
    assert run.status is replan.RunStatus.FAILED
    assert (run.replans, len(chosen.planner.problems)) == (4, 5)
    assert run.reason.endswith("; gave up after 4 re-plans")


def test_consumption_outside_of_the_box_leads_to_a_new_plan():
    planner = Scripted()
    chosen = mission(constant(Subject.CONSUMPTION, "(need b)", "9.5"), planner=planner)
    ready = prepared(chosen)
    box = Box({**ready.dispatchable.box.intervals, "need": Interval(F(1), F(9))})
    run = replan.execute(chosen, 0, replan.prepare_plan(ready.dispatchable.plan, chosen.options, box=box))
    assert (run.status, run.replans) == (replan.RunStatus.SUCCEEDED, 1)
    assert str(run.segments[0].ending) == "need = 9.5 is outside [1, 9]"
    assert planner.problems[0].fluents[Fluent("stock")] == F("0.5")
    assert planner.problems[0].fluents[Fluent("need", ("b",))] == 4


def test_an_action_that_never_ends_is_waited_for_and_said():
    class Endless(SimulatedWorld):
        def _complete(self, identifier, time):
            pass

    ready = prepared(mission())
    dispatcher = Dispatcher(ready.dispatchable)
    run_in_world(dispatcher, Endless(ready.setting, Luck(Rules(), 0)))
    assert isinstance(dispatcher.ending, LeftBox)
    assert (dispatcher.ended, dispatcher.running) == (False, ("n0",))


def test_a_rule_for_a_duration_of_ours_is_an_error():
    with pytest.raises(InputError, match="the dispatcher chooses; expected one that is fixed or a parameter"):
        ran(constant(Subject.DURATION, "work", 5), specs=())


def test_specifications_of_other_plans_are_passed_over():
    timed = parse_timed_plan("0: (work a) [10]\n")
    specs = parse_specs(["duration:work", "duration:fetch", "start:n0", "start:n4", "fluent:(need b)"])
    assert [spec.subject for spec in replan.fitting(specs, timed)] == ["work", "n0", "(need b)"]


# -- the same again ----------------------------------------------------------------------------------------------------


def without_seconds(run):
    segments = [replace(one, planner_seconds=0.0, preparation_seconds=0.0) for one in run.segments]
    return replace(run, seconds=0.0, segments=tuple(segments))


@pytest.mark.parametrize("seed", range(5))
def test_the_same_seed_gives_the_same_run(seed):
    rule = Rule(Subject.DURATION, "work", "normal", {"deviation": F(15), "minimum": F(1)})
    chosen = mission(rule, planner=Scripted())
    one, other = (without_seconds(replan.execute(chosen, seed, prepared(chosen))) for _ in range(2))
    assert one == other


def test_seeds_differ():
    rule = Rule(Subject.DURATION, "work", "normal", {"deviation": F(5), "minimum": F(1)})
    chosen = mission(rule, planner=Scripted())
    ready = prepared(chosen)
    assert len({replan.execute(chosen, seed, ready).end for seed in range(6)}) > 3


class FastClock:
    """Time jumps to wherever somebody wants to sleep to."""

    def __init__(self):
        self.time = F(0)

    def now(self):
        return self.time

    def seconds_until(self, moment):
        return float(moment - self.time)


@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: plan[3])
def test_driving_decides_as_simulation_does(plan):
    dispatchable = with_box(*plan)
    setting = Setting(dispatchable)
    simulated = Dispatcher(dispatchable)
    run_in_world(simulated, SimulatedWorld(setting, Luck(Rules(), 3)))

    async def in_real_time():
        dispatcher, world = Dispatcher(dispatchable), SimulatedWorld(setting, Luck(Rules(), 3))
        clock, inbox, announced = FastClock(), asyncio.Queue(), []
        for message in world.messages(F(0)):
            inbox.put_nowait(message)

        def announce(now, decisions):
            announced.extend(decisions)
            world.receive(now, decisions)
            moments = [time for time in (dispatcher.wake, world.next_time) if time is not None]
            if moments and inbox.empty():
                clock.time = max(clock.time, min(moments))
            for message in world.messages(clock.time):
                inbox.put_nowait(message)

        await asyncio.wait_for(drive(dispatcher, inbox, announce, clock), 20)
        return dispatcher, announced

    dispatcher, announced = asyncio.run(in_real_time())
    assert dispatcher.times == simulated.times
    assert dispatcher.ending == simulated.ending is None
    assert not [one for one in announced if isinstance(one, Rejected)]


# -- the judge ---------------------------------------------------------------------------------------------------------


def test_the_judge_finds_what_the_executive_does_not():
    ready = prepared(mission())
    world = SimulatedWorld(ready.setting, Luck(Rules(), 0))
    run_in_world(Dispatcher(ready.dispatchable), world)
    executed = list(world.executed.values())
    plan = ready.dispatchable.plan
    beginning = replan.Beginning(plan.initial_atoms, world.initial, plan.timed_literals, plan.goal)
    assert replan.judged(beginning, executed, EPSILON).valid
    late = replace(executed[-1], start=executed[-1].start + 50, end=executed[-1].end + 50)
    (violation,) = replan.judged(beginning, [*executed[:-1], late], EPSILON).violations
    assert "over all (open)" in violation.obligation
    poor = replace(beginning, fluents={**beginning.fluents, Fluent("stock"): F(3)})
    assert not replan.judged(poor, executed, EPSILON).valid
    (missing,) = replan.judged(beginning, executed[:-1], EPSILON).violations
    assert missing.obligation == "goal: (done b)"


def test_a_run_that_breaks_something_has_failed():
    """A box that is larger than the envelope promises too much; the judge is not deceived."""
    plan = tasks(
        "parameter first default 10;\ndurative-action instance w1 : (work a);\nc: w1.end - w1.start in [first, first];",
        problem=PROBLEM.replace("(and (done a) (done b))", "(and (done a) (open))"),
    )
    chosen = replan.Mission(
        DOMAIN_READ,
        parse_problem(FREE.replace("(and (done a) (done b))", "(and (done a) (open))"), DOMAIN_READ),
        rules=Rules((constant(Subject.DURATION, "w1", 30),)),
    )
    ready = replan.prepare_plan(plan, chosen.options, box=Box({"first": Interval(F(1), F(90))}))
    run = replan.execute(chosen, 0, ready)
    assert run.status is replan.RunStatus.FAILED
    assert run.reason.startswith("broke 'goal: (open)' at 60")


def test_blex_is_not_told_beforehand():
    chosen = replace(
        mission(constant(Subject.DURATION, "(work a)", 13)),
        options=replan.Options(executor=Blex(F(3, 10)), specs=SPECS),
    )
    ready = prepared(chosen)
    assert isinstance(ready, replan.Prepared)
    assert replan.execute(chosen, 0, ready).status is replan.RunStatus.SUCCEEDED
    worse = replace(chosen, rules=Rules((constant(Subject.DURATION, "(work a)", F("13.001")),)))
    assert "n0" in replan.execute(worse, 0, ready).reason


@pytest.mark.parametrize("controllability", ["dynamic", "strong"])
def test_boxes_may_be_shrunk_to_what_can_be_controlled(controllability):
    chosen = replace(mission(), options=replan.Options(specs=SPECS, controllability=controllability))
    whole, part = prepared(mission()).dispatchable.box, prepared(chosen).dispatchable.box
    assert all(part[name].is_within(whole[name]) for name in whole.intervals)
