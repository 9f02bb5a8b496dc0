"""Runs with re-planning: the problem that is left, planners that help or do not, and the judge's last word."""

import asyncio
from dataclasses import dataclass, field, replace
from fractions import Fraction

import pytest

from robust.errors import InputError, UnsupportedError
from robust.execute import replan
from robust.execute.dispatchable import Blex
from robust.execute.dispatcher import Dispatcher, LeftBox, MessageRejected
from robust.execute.drive import drive, run_in_world
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.execute.worlds import InstanceOutcome, Luck, Rules, SimulatedWorld, Subject
from robust.plan.model import Atom, Fluent, TimedLiteral
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.timed import parse_timed_plan
from robust.plan.timeline import State
from robust.qe.box import Box, Interval
from tests.execute.plans import PLANS, TASKS, TWO_TASKS, constant, tasks, with_box, working

F = Fraction
EPSILON = F(1, 1000)
# One thing at a time.
SERIAL = (
    TASKS.replace("(at start (ready ?t))", "(at start (ready ?t)) (at start (free))")
    .replace("(at start (not (ready ?t)))", "(at start (not (ready ?t))) (at start (not (free))) (at end (free))")
    .replace("(at start (>= (stock) (need ?t)))", "(and (at start (>= (stock) (need ?t))) (at start (free)))")
)
FREE = TWO_TASKS.replace("(:init", "(:init (free)")
DONE = "(and (done a) (done b))"
DOMAIN_READ = parse_domain(SERIAL)
PROBLEM_READ = parse_problem(FREE, DOMAIN_READ)
FIRST = "0: (work a) [10]\n10.001: (fetch b) [2]\n12.002: (work b) [6]\n"
SPECS = parse_specs(["duration:work", "need=fluent:(need b)"])


@dataclass
class Scripted:
    """Answers with plans for what is still to be done, or always with one `plan`, and remembers the problems."""

    name: str = "scripted"
    problems: list = field(default_factory=list)
    silent_after: int = 99
    error: Exception | None = None
    plan: str = ""

    def solve(self, domain, problem, deadline):
        assert deadline.remaining <= 7
        self.problems.append(problem)
        if self.error is not None:
            raise self.error
        if len(self.problems) > self.silent_after:
            return PlannerAnswer(self.name, PlannerStatus.NO_PLAN, None, 0.1, "nothing to be found")
        lines, time = [self.plan], F(0)
        for task in "ab" if not self.plan else "":
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
    return replan.Mission(
        DOMAIN_READ, PROBLEM_READ, planner, Rules(rules), options=replan.ReplanningOptions(specs=specs), **more
    )


def prepared(chosen):
    return replan.prepare_timed(DOMAIN_READ, PROBLEM_READ, parse_timed_plan(FIRST), chosen.options)


def ran(*rules, **more):
    """The run of a mission."""
    chosen = mission(*rules, **more)
    return replan.execute(chosen, 0, prepared(chosen))


def test_the_next_plan_begins_in_the_state_reached_after_what_has_just_happened():
    state = State(frozenset({Atom("done", ("a",)), Atom("open")}), {Fluent("stock"): F(7)})
    left = replan.remaining_problem(PROBLEM_READ, state, F(25))
    assert (left.atoms, left.fluents, left.goal) == (state.atoms, {Fluent("stock"): 7}, PROBLEM_READ.goal)
    assert [(one.time, one.value) for one in left.timed_literals] == [(35, False)]
    assert replan.remaining_problem(PROBLEM_READ, state, F(60)).timed_literals == ()
    literals = [TimedLiteral(F(5), Atom("open"), True), TimedLiteral(F(5) + EPSILON / 2, Atom("open"), False)]
    assert replan.origin_after(F(3), literals, EPSILON) == 3 + EPSILON
    for time in (F(5) - EPSILON / 2, F(5) - EPSILON):
        assert replan.origin_after(time, literals, EPSILON) == 5 + EPSILON + EPSILON / 2


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
    assert (first.end, second.start) == (45, 45 + EPSILON)
    (problem,) = planner.problems
    assert Atom("done", ("a",)) in problem.atoms
    assert [one.time for one in problem.timed_literals] == [15 - EPSILON]
    assert [(one.instance.action, one.outcome) for one in (*first.executed, *second.executed)] == [
        ("work", InstanceOutcome.DONE), ("fetch", InstanceOutcome.DONE), ("work", InstanceOutcome.DONE),
    ]  # fmt: skip
    assert second.executed[0].start == 45 + EPSILON
    assert all(one.time >= second.start for one in second.observations)


def test_planning_may_take_time_in_the_world_and_running_actions_may_be_stopped():
    planner = Scripted()
    run = ran(LATE, planner=planner, planning_time=F(3))
    assert run.segments[1].start == 48 + EPSILON
    assert [one.time for one in planner.problems[0].timed_literals] == [12 - EPSILON]
    planner = Scripted(silent_after=0)
    (segment,) = ran(LATE, planner=planner, drain=False).segments
    assert [(one.outcome, one.end) for one in segment.executed] == [(InstanceOutcome.STOPPED, segment.given_up)]
    assert segment.given_up < 45
    # the effect at the start has happened, that at the end has not
    assert not planner.problems[0].atoms & {Atom("ready", ("a",)), Atom("done", ("a",))}


def test_a_plan_that_is_given_up_when_all_is_done_has_succeeded():
    """The last action takes longer than the executor accepts; it is waited for, and there is nothing left to plan."""
    planner = Scripted()
    chosen = mission(constant(Subject.DURATION, "(work b)", 9), planner=planner)
    chosen = replace(chosen, options=replace(chosen.options, executor=Blex(F(1, 10))))
    run = replan.execute(chosen, 0, prepared(chosen))
    assert (run.status, run.reason, run.replans, planner.problems) == (replan.RunStatus.SUCCEEDED, "", 0, [])
    assert (run.inside, run.segments[-1].executed[-1].outcome) == (False, InstanceOutcome.DONE)
    stopped = replan.execute(replace(chosen, drain=False), 0, prepared(chosen))
    assert (len(planner.problems), stopped.segments[0].executed[-1].outcome) == (1, InstanceOutcome.STOPPED)
    rules = Rules((constant(Subject.DURATION, "(work b)", 90),))
    late = replan.execute(replace(chosen, rules=rules), 0, prepared(chosen))
    assert late.status is replan.RunStatus.FAILED  # what has to hold during the action does not


@pytest.mark.parametrize(
    ("planner", "message"),
    [
        (Scripted(silent_after=0), "scripted: no plan: nothing to be found"),
        (Scripted(error=UnsupportedError("no numbers")), "no numbers"),
        (Scripted(plan="0: (work b) [6]"), "invalid plan"),
    ],
)
def test_a_planner_that_cannot_help_ends_the_run(planner, message):
    with pytest.raises(replan.NoPlanError, match=message):
        replan.first_plan(mission(planner=planner))
    run = ran(LATE, planner=planner)
    assert run.status is replan.RunStatus.FAILED
    assert message in run.reason
    assert ran(LATE).reason.endswith("there is no planner to ask for another plan")


def test_re_plans_are_counted_and_limited():
    """Nature is never as the planner expects."""
    text = FREE.replace(DONE, "(done b)").replace("(= (stock) 10)", "(= (stock) 1000)")
    problem = parse_problem(text.replace("(at 60 (not (open)))", ""), DOMAIN_READ)
    planner = Scripted(plan="0: (fetch b) [2]\n2.001: (work b) [6]")
    chosen = mission(constant(Subject.DURATION, "fetch", 3), planner=planner, replans=4, specs=())
    run = replan.execute(replace(chosen, problem=problem), 0)
    assert (run.status, run.replans, len(planner.problems)) == (replan.RunStatus.FAILED, 4, 5)
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

    dispatchable = prepared(mission()).dispatchable
    dispatcher = Dispatcher(dispatchable)
    run_in_world(dispatcher, Endless(dispatchable, Luck(Rules(), 0)))
    assert isinstance(dispatcher.ending, LeftBox)
    assert (dispatcher.ended, dispatcher.running) == (False, ("n0",))


def test_a_rule_for_a_duration_of_ours_is_an_error():
    with pytest.raises(InputError, match="the dispatcher chooses; expected one that is fixed or a parameter"):
        ran(constant(Subject.DURATION, "work", 5), specs=())


def test_specifications_of_other_plans_are_passed_over():
    timed = parse_timed_plan("0: (work a) [10]\n")
    specs = parse_specs(["duration:work", "duration:fetch", "start:n0", "start:n4", "fluent:(need b)"])
    assert [spec.subject for spec in replan.fitting(specs, timed)] == ["work", "n0", "(need b)"]


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
    simulated = Dispatcher(dispatchable)
    run_in_world(simulated, SimulatedWorld(dispatchable, Luck(Rules(), 3)))

    async def in_real_time():
        dispatcher, world = Dispatcher(dispatchable), SimulatedWorld(dispatchable, Luck(Rules(), 3))
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
    assert not [one for one in announced if isinstance(one, MessageRejected)]


def test_the_judge_finds_what_the_executive_does_not():
    ready = prepared(mission())
    world = SimulatedWorld(ready.dispatchable, Luck(Rules(), 0))
    run_in_world(Dispatcher(ready.dispatchable), world)
    executed = list(world.executed.values())
    beginning = replan.beginning(ready.dispatchable.plan, world)
    assert replan.judged(beginning, executed, EPSILON).valid
    late = replace(executed[-1], start=executed[-1].start + 50, end=executed[-1].end + 50)
    (violation,) = replan.judged(beginning, [*executed[:-1], late], EPSILON).violations
    assert "over all (open)" in violation.obligation
    poor = replace(beginning, initial_fluents={**beginning.initial_fluents, Fluent("stock"): Polynomial.constant(3)})
    assert not replan.judged(poor, executed, EPSILON).valid
    (missing,) = replan.judged(beginning, executed[:-1], EPSILON).violations
    assert missing.obligation == "goal: (done b)"


def test_a_run_that_breaks_something_has_failed():
    """A box that is larger than the envelope promises too much; the judge is not deceived."""
    goal = "(and (done a) (open))"
    plan = tasks(working(on="a"), problem=TWO_TASKS.replace(DONE, goal))
    rules = Rules((constant(Subject.DURATION, "w1", 30),))
    chosen = replan.Mission(DOMAIN_READ, parse_problem(FREE.replace(DONE, goal), DOMAIN_READ), rules=rules)
    run = replan.execute(
        chosen, 0, replan.prepare_plan(plan, chosen.options, box=Box({"first": Interval(F(1), F(90))}))
    )
    assert run.status is replan.RunStatus.FAILED
    assert run.reason.startswith("broke 'goal: (open)' at 60")
