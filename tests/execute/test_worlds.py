"""Simulated worlds: draws, files, luck and actions; executives in them and in real time; runs with re-planning."""

import asyncio
import re
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from robust.errors import InputError, UnsupportedError
from robust.execute import replan, situation
from robust.execute.dispatchable import Blex
from robust.execute.dispatcher import Completed, Dispatch, Dispatcher, DispatchFailed, LeftBox, Observed
from robust.execute.drive import WallClock, drive, run_in_world
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.execute.rules import Rule, Rules, Subject, parse_rules
from robust.execute.worlds import InstanceOutcome, Luck, SimulatedWorld
from robust.plan.model import Atom, Fluent, TimedLiteral
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.timed import parse_timed_plan
from robust.plan.timeline import State
from robust.probability.distributions import Amount, Below, DistributionForm
from tests.execute import plans
from tests.execute.plans import EPSILON, box_of, constant, tasks, tasks_dispatchable, text_of, working

F = Fraction
FILE = text_of("world.toml")
DONE, FAILED, STOPPED = InstanceOutcome.DONE, InstanceOutcome.FAILED, InstanceOutcome.STOPPED


def drawn(distribution, below=Below.FOLD, count=4000, **numbers):
    amounts = {key: (Amount(F(value)),) for key, value in numbers.items()}
    rule = Rule(Subject.PARAMETER, "p", DistributionForm(distribution, amounts, below))
    random = Random(7)  # noqa: S311 - reproducible
    return [rule.about(F(0)).draw(random) for _ in range(count)]


def test_draws_are_exact_and_fill_their_distributions():
    assert drawn("constant", count=2, value=F(1, 3)) == [F(1, 3), F(1, 3)]
    plain = drawn("normal", mean=10, deviation=5)
    assert all(isinstance(value, Fraction) and 1000 % value.denominator == 0 for value in plain)
    folded = drawn("normal", mean=10, deviation=5, minimum=8)
    assert folded == [value if value >= 8 else 16 - value for value in plain]
    clipped = drawn("normal", Below.CLIP, mean=10, deviation=5, minimum=8)
    assert clipped == [max(value, F(8)) for value in plain]


def test_a_world_file_is_read_exactly():
    rules, instances = parse_rules(FILE), tasks_dispatchable().plan.instance
    w1, f = rules.duration(instances["w1"]), rules.duration(instances["f"])
    assert (w1.about(F(10)).numbers, w1.form.below) == ({"mean": 10, "deviation": F(5, 2), "minimum": 4}, Below.CLIP)
    assert f.about(F(2)).numbers == {"lower": 1, "upper": F(7, 3)}
    need = rules.consumption(Fluent("need", ("b",)))
    assert (need.about(F(4)).numbers, need.about(F(-4)).numbers) == (
        {"lower": 2, "upper": 6},
        {"lower": -6, "upper": -2},
    )
    assert rules.parameter("first").about(F(10)).numbers == {"origin": 10, "deviation": 3}
    assert rules.duration(instances["w2"]) is rules.parameter("second") is None
    observed = parse_rules(
        '[[draw]]\nduration = "work"\ndistribution = "empirical"\nvalues = [3, 2.5, 3]\nweights = [1, 2, 1]\n'
    )
    assert str(observed.duration(instances["w1"]).about(F(10))) == "empirical:2.5,3"
    # The first rule that fits counts.
    table = '[[draw]]\nduration = "{}"\ndistribution = "constant"\nvalue = {}\n'
    both = parse_rules(table.format("w1", 3) + table.format("work", 5))
    assert [both.duration(instances[name]).about(F(1)).numbers for name in ("w1", "w2")] == [{"value": 3}, {"value": 5}]


@pytest.mark.parametrize("case", text_of("wrong-worlds.txt").split("== ")[1:])
def test_wrong_world_files_say_what_is_wrong(case):
    message, _, text = case.partition("\n")
    with pytest.raises(InputError, match=message) as raised:
        parse_rules(text, "world.toml")
    assert re.fullmatch("world.toml.*", str(raised.value)), "on one line"


def test_luck_does_not_depend_on_the_order_of_draws():
    instances = tasks_dispatchable().plan.instance
    one, other, another = (Luck(parse_rules(FILE), seed) for seed in (5, 5, 6))
    w1, f = one.duration(instances["w1"], F(10)), one.duration(instances["f"], F(2))
    assert (other.duration(instances["f"], F(2)), other.duration(instances["w1"], F(10))) == (f, w1)
    assert f not in {one.duration(instances["f"], F(2)), another.duration(instances["f"], F(2))}
    assert one.duration(instances["w2"], F(6)) is None
    assert one.parameter("first", F(1), once=True) == one.parameter("first", F(1), once=True)
    assert one.parameter("first", F(1), once=False) != one.parameter("first", F(1), once=False)


NEED = {"specs": ("need=fluent:(need b)",), "box": {"first": (4, 20), "need": (1, 12)}}


def world_of(*rules, specs=(), box=None):
    dispatchable = tasks_dispatchable(box, plans.PLAN, *specs)
    return dispatchable, SimulatedWorld(dispatchable, Luck(Rules(rules), 0))


def executed(*rules, **options):
    """A dispatcher that has ended, and its world."""
    dispatchable, world = world_of(*rules, **options)
    dispatcher = Dispatcher(dispatchable)
    run_in_world(dispatcher, world)
    return dispatcher, world


def test_without_rules_nature_does_what_is_planned():
    dispatcher, world = executed()
    assert dispatcher.ending is None
    runs = {name: (run.end - run.start, run.outcome) for name, run in world.executed.items()}
    assert runs == {"w1": (10, DONE), "f": (2, DONE), "w2": (5, DONE), "c": (0, DONE)}
    assert world.state.fluents[Fluent("stock")] == 6
    assert Atom("done", ("b",)) in world.state.atoms


def test_an_action_whose_condition_does_not_hold_does_not_start():
    dispatchable, world = world_of()
    world.receive(F(1), [Dispatch(dispatchable.plan.instance["w2"].start, F(1))])
    assert world.messages(F(1)) == [DispatchFailed("w2", F(1), "(ready b) does not hold")]
    assert world.executed == {}


@pytest.mark.parametrize(("length", "fails"), [(60, False), (80, True)])
def test_an_action_whose_condition_stops_to_hold_at_60_fails(length, fails):
    dispatchable, world = world_of(constant(Subject.DURATION, "w1", length), box={"first": (4, 100)})
    world.receive(F(0), [Dispatch(dispatchable.plan.instance["w1"].start, F(0))])
    assert world.next_time == 60
    said = DispatchFailed("w1", F(60), "(open) does not hold") if fails else Completed("w1", F(60))
    assert world.messages(F(60)) == [said]
    assert (world.executed["w1"].outcome, world.executed["w1"].end) == (FAILED if fails else DONE, 60)
    assert world.messages(F(90)) == []
    assert (Atom("done", ("a",)) in world.state.atoms) is not fails


def test_consumption_and_initial_levels_are_drawn_and_shown():
    dispatcher, world = executed(constant(Subject.CONSUMPTION, "need", 5), **NEED)
    assert (dispatcher.ending, dispatcher.observed["need"]) == (None, 5)
    assert world.state.fluents[Fluent("stock")] == 5
    assert world.state.fluents[Fluent("need", ("b",))] == 4  # what is expected of the next time
    # What an action really needs decides whether it starts.
    dispatcher, _ = executed(constant(Subject.PARAMETER, "need", 11), **NEED)
    assert isinstance(dispatcher.ending, DispatchFailed)
    assert "(>= (stock) (need b)) does not hold" in str(dispatcher.ending)
    # Initial levels are drawn, and shown at the beginning.
    rule = constant(Subject.PARAMETER, "level", 8)
    dispatchable, world = world_of(rule, specs=("level=fluent:(stock)",), box={"first": (4, 20), "level": (5, 12)})
    assert world.messages(F(0)) == [Observed("level", F(8))]
    assert world.initial[Fluent("stock")] == 8
    known = SimulatedWorld(dispatchable, Luck(Rules((rule,)), 0), levels_known=True)
    assert known.initial[Fluent("stock")] == 10


class Echo:
    """Answers every message, asks to be woken at some moments, and ends after the last."""

    def __init__(self, *wakes):
        self.steps, self.wakes = [], wakes

    wake = property(lambda self: min(self.wakes, default=None))
    ended = property(lambda self: not self.wakes)

    def step(self, now, messages):
        self.steps.append((now, tuple(messages)))
        self.wakes = [wake for wake in self.wakes if wake > now]
        return [f"{message}!" for message in messages]


class Shout:
    """Says one thing at a set time, and another at once when it is answered."""

    def __init__(self, moment):
        self.pending = [(moment, "a")]

    next_time = property(lambda self: min((moment for moment, _ in self.pending), default=None))

    def receive(self, now, decisions):
        self.pending += [(now, "b") for decision in decisions if decision == "a!"]

    def messages(self, now):
        due = [text for moment, text in self.pending if moment <= now]
        self.pending = [entry for entry in self.pending if entry[0] > now]
        return due


ONE, TWO, BETWEEN = F(1, 100), F(2, 100), F(3, 200)


def test_simulation_steps_at_messages_and_wakes_up_to_the_horizon_and_consequences_come_at_the_same_time():
    executive = Echo(ONE, TWO)
    assert run_in_world(executive, Shout(BETWEEN)) == TWO
    assert executive.steps == [(0, ()), (ONE, ()), (BETWEEN, ("a",)), (BETWEEN, ("b",)), (TWO, ())]
    executive = Echo(ONE, TWO)
    assert run_in_world(executive, Shout(F(5)), horizon=F(19, 1000)) == F(19, 1000)
    assert [moment for moment, _ in executive.steps] == [0, ONE]


def driven(executive, *messages):
    """What is announced if these messages are there from the beginning."""

    async def run():
        announced, inbox = [], asyncio.Queue()
        for message in messages:
            inbox.put_nowait(message)
        await drive(executive, inbox, lambda now, decisions: announced.extend(decisions), WallClock())
        return announced

    return asyncio.run(run())


def test_real_time_wakes_the_executive_and_hands_over_messages():
    executive = Echo(ONE, TWO)
    assert driven(executive, "a", "b") == ["a!", "b!"]
    times = [moment for moment, _ in executive.steps]
    assert times == sorted(times)
    assert times[-1] >= TWO
    assert executive.steps[1][1] == ("a", "b")
    endless = Echo(F(1000))
    driven(endless, "a", None)  # the inbox is closed
    assert [messages for _, messages in endless.steps] == [(), ("a",)]


# One thing at a time.
SERIAL = (
    plans.TASKS.replace("(at start (ready ?t))", "(at start (ready ?t)) (at start (free))")
    .replace("(at start (not (ready ?t)))", "(at start (not (ready ?t))) (at start (not (free))) (at end (free))")
    .replace("(at start (>= (stock) (need ?t)))", "(and (at start (>= (stock) (need ?t))) (at start (free)))")
)
FREE = plans.TWO_TASKS.replace("(:init", "(:init (free)")
BOTH = "(and (done a) (done b))"
DOMAIN_READ = parse_domain(SERIAL)
PROBLEM_READ = parse_problem(FREE, DOMAIN_READ)
FIRST = "0: (work a) [10]\n10.001: (fetch b) [2]\n12.002: (work b) [6]\n"
SPECS = parse_specs(["duration:work", "need=fluent:(need b)"])
SUCCEEDED, LOST = replan.RunStatus.SUCCEEDED, replan.RunStatus.FAILED


class Scripted:
    """Answers with plans for what is still to be done, or always with one `plan`, and remembers the problems."""

    name = "scripted"

    def __init__(self, plan="", *, silent=False, error=None):
        self.plan, self.silent, self.error, self.problems = plan, silent, error, []

    def solve(self, domain, problem, deadline):
        assert deadline.remaining <= 7
        self.problems.append(problem)
        if self.error is not None:
            raise self.error
        if self.silent:
            return PlannerAnswer(self.name, PlannerStatus.NO_PLAN, None, 0.1, "nothing to be found")
        lines, time = [self.plan], F(0)
        for task in (task for task in "ab" if not self.plan and Atom("done", (task,)) not in problem.atoms):
            for action, length in (("fetch", 2), ("work", 6))[Atom("ready", (task,)) in problem.atoms :]:
                lines.append(f"{time}: ({action} {task}) [{length}]")
                time += length + EPSILON
        return PlannerAnswer(self.name, PlannerStatus.SOLVED, parse_timed_plan("\n".join(lines)), 0.1)


LATE = constant(Subject.DURATION, "(work a)", 45)


def mission(*rules, planner=None, specs=SPECS, problem=PROBLEM_READ, **more):
    options = replan.ReplanningOptions(specs=specs, free_durations=True)
    return replan.Mission(DOMAIN_READ, problem, planner, Rules(rules), options=options, **more)


def prepared(chosen):
    return replan.prepare_timed(DOMAIN_READ, PROBLEM_READ, parse_timed_plan(FIRST), chosen.options)


def ran(*rules, **more):
    chosen = mission(*rules, **more)
    return replan.execute(chosen, 0, prepared(chosen))


def ending(run):
    return run.status, run.reason, run.replans, run.inside


def test_the_next_plan_begins_in_the_state_reached_after_what_has_just_happened():
    state = State(frozenset({Atom("done", ("a",)), Atom("open")}), {Fluent("stock"): F(7)})
    problem = replan.remaining_problem(PROBLEM_READ, state, F(25))
    assert (problem.atoms, problem.fluents, problem.goal) == (state.atoms, {Fluent("stock"): 7}, PROBLEM_READ.goal)
    assert [(literal.time, literal.value) for literal in problem.timed_literals] == [(35, False)]
    assert replan.remaining_problem(PROBLEM_READ, state, F(60)).timed_literals == ()
    half, opened = EPSILON / 2, Atom("open")
    literals = [TimedLiteral(F(5), opened, True), TimedLiteral(5 + half, opened, False)]
    origins = [replan.origin_after(time, literals, EPSILON) for time in (F(3), 5 - half, 5 - EPSILON)]
    assert origins == [3 + EPSILON, 5 + 3 * half, 5 + 3 * half]
    later = replan.origin_after(F(3), (), F(0))
    assert 3 < later < replan.origin_after(F(3), [TimedLiteral(later, opened, True)], F(0))


def test_a_run_without_surprises_succeeds_without_asking_anybody():
    run = ran()
    assert (ending(run), run.end) == ((SUCCEEDED, "", 0, True), 18 + 2 * EPSILON)


def test_a_run_re_plans_from_the_state_reached():
    planner = Scripted()
    run = ran(LATE, planner=planner)
    assert ending(run) == (SUCCEEDED, "", 1, False)
    first, second = run.segments
    assert isinstance(first.ending, LeftBox)
    assert first.given_up < 45
    assert (first.end, second.start, second.executed[0].start) == (45, 45 + EPSILON, 45 + EPSILON)
    (problem,) = planner.problems
    assert Atom("done", ("a",)) in problem.atoms
    assert [literal.time for literal in problem.timed_literals] == [15 - EPSILON]
    done = [(run.instance.action, run.outcome) for run in (*first.executed, *second.executed)]
    assert done == [("work", DONE), ("fetch", DONE), ("work", DONE)]
    assert all(observation.time >= second.start for observation in second.observations)


def test_planning_may_take_time_in_the_world_and_running_actions_may_be_stopped():
    planner = Scripted()
    run = ran(LATE, planner=planner, planning_time=F(3))
    assert run.segments[1].start == 48 + EPSILON
    assert [literal.time for literal in planner.problems[0].timed_literals] == [12 - EPSILON]
    planner = Scripted(silent=True)
    (segment,) = ran(LATE, planner=planner, drain=False).segments
    assert [(run.outcome, run.end) for run in segment.executed] == [(STOPPED, segment.given_up)]
    assert segment.given_up < 45
    # the effect at the start has happened, that at the end has not
    assert not planner.problems[0].atoms & {Atom("ready", ("a",)), Atom("done", ("a",))}


def test_a_plan_that_is_given_up_when_all_is_done_has_succeeded():
    """The last action takes longer than the executor accepts; it is waited for, and there is nothing left to plan."""
    planner = Scripted()
    chosen = mission(constant(Subject.DURATION, "(work b)", 9), planner=planner)
    chosen = replace(chosen, options=replace(chosen.options, executor=Blex(F(1, 10))))
    run = replan.execute(chosen, 0, prepared(chosen))
    assert (ending(run), planner.problems) == ((SUCCEEDED, "", 0, False), [])
    assert run.segments[-1].executed[-1].outcome is DONE
    stopped = replan.execute(replace(chosen, drain=False), 0, prepared(chosen))
    assert (len(planner.problems), stopped.segments[0].executed[-1].outcome) == (1, STOPPED)
    rules = Rules((constant(Subject.DURATION, "(work b)", 90),))
    late = replan.execute(replace(chosen, rules=rules), 0, prepared(chosen))
    assert late.status is LOST  # what has to hold during the action does not


@pytest.mark.parametrize(
    ("planner", "message"),
    [
        (Scripted(silent=True), "scripted: no plan: nothing to be found"),
        (Scripted(error=UnsupportedError("no numbers")), "no numbers"),
        (Scripted("0: (work b) [6]"), "invalid plan"),
    ],
)
def test_a_planner_that_cannot_help_ends_the_run(planner, message):
    with pytest.raises(replan.NoPlanError, match=message):
        replan.first_plan(mission(planner=planner))
    run = ran(LATE, planner=planner)
    assert (run.status, message in run.reason) == (LOST, True)
    assert ran(LATE).reason.endswith("there is no planner to ask for another plan")


def test_re_plans_are_counted_and_limited():
    text = FREE.replace(BOTH, "(done b)").replace("(= (stock) 10)", "(= (stock) 1000)")
    problem = parse_problem(text.replace("(at 60 (not (open)))", ""), DOMAIN_READ)
    planner, rule = Scripted("0: (fetch b) [2]\n2.001: (work b) [6]"), constant(Subject.DURATION, "fetch", 3)
    run = replan.execute(mission(rule, planner=planner, replans=4, specs=(), problem=problem), 0)
    assert (run.status, run.replans, len(planner.problems)) == (LOST, 4, 5)
    assert run.reason.endswith("; gave up after 4 re-plans")


def test_consumption_outside_of_the_box_leads_to_a_new_plan():
    planner = Scripted()
    chosen = mission(constant(Subject.CONSUMPTION, "(need b)", "9.5"), planner=planner)
    ready = prepared(chosen).dispatchable
    box = ready.box.changed(box_of(need=(1, 9)).intervals)
    run = replan.execute(chosen, 0, replan.prepare_plan(ready.plan, chosen.options, box=box))
    assert (run.status, run.replans, str(run.segments[0].ending)) == (SUCCEEDED, 1, "need = 9.5 is outside [1, 9]")
    fluents = planner.problems[0].fluents
    assert (fluents[Fluent("stock")], fluents[Fluent("need", ("b",))]) == (F("0.5"), 4)


def test_an_action_that_never_ends_is_waited_for_and_said():
    class Endless(SimulatedWorld):
        def _complete(self, identifier, time):
            pass

    dispatchable = prepared(mission()).dispatchable
    dispatcher = Dispatcher(dispatchable)
    run_in_world(dispatcher, Endless(dispatchable, Luck(Rules(), 0)))
    assert isinstance(dispatcher.ending, LeftBox)
    assert (dispatcher.ended, dispatcher.running) == (False, ("n0",))


def test_rules_and_specifications_are_about_what_plans_have():
    with pytest.raises(InputError, match="the dispatcher chooses; expected one that is fixed or a parameter"):
        ran(constant(Subject.DURATION, "work", 5), specs=())
    specs = parse_specs(["duration:work", "duration:fetch", "start:n0", "start:n4", "fluent:(need b)"])
    fitting = situation.fitting(specs, parse_timed_plan("0: (work a) [10]\n"))
    assert [spec.subject for spec in fitting] == ["work", "n0", "(need b)"]


def test_the_judge_finds_what_the_executive_does_not():
    ready = prepared(mission()).dispatchable
    world = SimulatedWorld(ready, Luck(Rules(), 0))
    run_in_world(Dispatcher(ready), world)
    runs = list(world.executed.values())
    beginning = replan.beginning(ready.plan, world)
    assert replan.judged(beginning, runs, EPSILON).valid
    late = replace(runs[-1], start=runs[-1].start + 50, end=runs[-1].end + 50)
    (violation,) = replan.judged(beginning, [*runs[:-1], late], EPSILON).violations
    assert "over all (open)" in violation.obligation
    poor = replace(beginning, initial_fluents={**beginning.initial_fluents, Fluent("stock"): Polynomial.constant(3)})
    assert not replan.judged(poor, runs, EPSILON).valid
    (missing,) = replan.judged(beginning, runs[:-1], EPSILON).violations
    assert missing.obligation == "goal: (done b)"


def test_a_run_that_breaks_something_has_failed():
    """A box that is larger than the envelope promises too much; the judge is not deceived."""
    goal = "(and (done a) (open))"
    plan = tasks(working(on="a"), problem=plans.TWO_TASKS.replace(BOTH, goal))
    problem = parse_problem(FREE.replace(BOTH, goal), DOMAIN_READ)
    chosen = mission(constant(Subject.DURATION, "w1", 30), specs=(), problem=problem)
    run = replan.execute(chosen, 0, replan.prepare_plan(plan, chosen.options, box=box_of(first=(1, 90))))
    assert (run.status, run.reason.startswith("broke 'goal: (open)' at 60")) == (LOST, True)
