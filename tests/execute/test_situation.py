"""Plans from where an execution is: what runs is kept, and the whole run is valid in the problem as it was."""

from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

import robust
from robust.errors import UnsupportedError
from robust.execute import situation
from robust.execute.convert import Settings
from robust.execute.messages import MessageKind, MonitorMessage
from robust.execute.monitor import Monitor
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus, check
from robust.execute.situation import NoPlanError, OpenProblem, new_plan, run_state
from robust.irr.proposals import SlackPlan
from robust.plan.model import Atom
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem, read_domain, read_problem
from robust.plan.simulate import simulate
from robust.plan.stn import parse_stn
from robust.plan.timed import parse_timed_plan
from robust.probability.distributions import Distribution
from tests.cli.running import EXAMPLES
from tests.sampling import often

EPSILON = Fraction(1, 1000)
FILES = [EXAMPLES / "workshop" / name for name in ("domain.pddl", "problem.pddl")]
DOMAIN = read_domain(FILES[0])
PROBLEM = read_problem(FILES[1], DOMAIN)
SPECS = parse_specs(["duration:*"])
LENGTHS = {str(fluent): value for fluent, value in PROBLEM.fluents.items()}
WORK = (("saw", "cutting"), ("paint", "painting"), ("pack", "packing"))


def workshop(**options):
    return robust.load_plan(*FILES, FILES[0].with_name("plan.log"), parameters=["duration:*"], **options)


class OneByOne:
    """Plans for the workshop by hand: what runs, and then one thing after the other; slower ones first."""

    name = "by hand"

    def __init__(self, *pauses):
        self.pauses = pauses or (0,)

    def solve(self, domain, problem, deadline):
        plans = [self.plan(problem, pause) for pause in self.pauses]
        for plan in plans:
            check(plan, domain, problem, EPSILON)
        return PlannerAnswer(self.name, PlannerStatus.SOLVED, plans[-1], others=tuple(plans[:-1]))

    def plan(self, problem, pause):
        left = {atom: Fraction(0) for atom in problem.atoms if atom.predicate.startswith(situation.RUNNING)}
        for fluent, value in problem.fluents.items():
            if fluent.function.startswith(situation.LEFT):
                left[Atom(fluent.function.replace(situation.LEFT, situation.RUNNING), fluent.arguments)] = value
        lines = [f"0: {atom} [{length}]" for atom, length in left.items()]
        now = max(left.values(), default=Fraction(0)) + Fraction(1, 100)
        done = {(atom.predicate.removeprefix(situation.RUNNING), atom.arguments[-1]) for atom in left}
        for part in ("chair", "table", "shelf"):
            states = {atom.predicate for atom in problem.atoms if atom.arguments == (part,)}
            steps = [number for number, (action, _) in enumerate(WORK, start=1) if (action, part) in done]
            steps += [number for number, state in enumerate(("raw", "cut", "painted", "packed")) if state in states]
            for action, length in WORK[steps[0] :]:
                lasts = LENGTHS[f"({length} {part})"]
                lines.append(f"{float(now)}: ({action} ann {part}) [{lasts}]")
                now += lasts + Fraction(1, 100) + pause
        return parse_timed_plan("\n".join(lines))


def run_for_a_while(random):
    """A monitor of the workshop's plan that was told of some starts and ends, at times that a clock might show."""
    monitor = Monitor(workshop(deadline=400))
    now, due = Fraction(0), {}
    for _ in range(random.randrange(12)):
        ready = monitor.outlook().startable
        if ready and random.random() < 0.7:
            look = random.choice(ready)
            monitor.say("start", look.step, at=now)
            due[look.step] = now + monitor.planned[look.step] * Fraction(random.randrange(50, 200), 100)
        elif due:
            step = min(due, key=due.get)
            now = max(now, due.pop(step))
            monitor.say("end", step, at=now)
        now += Fraction(random.randrange(1, 3000), 1000)
        monitor.tell(MonitorMessage(MessageKind.TICK, at=now))
    return monitor


def whole_run(monitor, found):
    """All that was executed and the new plan at its earliest, as one plan of the first problem; natural durations."""
    ended = {step: (start, end) for step, _, start, end in monitor.ended}
    before = [replace(monitor.plan.instance[step], durations=()) for step in ended]
    first = monitor.plan.instance
    after = [replace(first.get(each.identifier, each), durations=()) for each in found.plan.instances]
    schedule = {}
    for instance in before:
        schedule |= dict(zip((instance.start, instance.end), ended[instance.identifier], strict=True))
    times = SlackPlan(found.plan, EPSILON)
    for point, ticks in zip(found.plan.time_points, times.times, strict=True):
        if point.instance is not None:
            schedule[point] = Fraction(ticks, times.scale)
    bare = replace(monitor.plan, instances=(*before, *after), constraints=(), parameters=())
    return simulate(bare, {}, schedule, epsilon=EPSILON)


@pytest.mark.parametrize("first", range(0, often(12, 400), 4))
def test_a_new_plan_goes_on_where_the_run_is(first):
    count = 0
    for seed in range(first, first + 4):
        random = Random(seed)  # noqa: S311 - reproducible
        monitor = run_for_a_while(random)
        here = run_state(monitor)
        remainder = OpenProblem(DOMAIN, PROBLEM, here, Fraction(random.randrange(5)), EPSILON, Fraction(400))
        if monitor.outlook().prospect is robust.Prospect.DONE:
            continue  # nothing is left to be planned
        found = new_plan(remainder, OneByOne(), None, Settings(specs=SPECS, deadline=Fraction(400), epsilon=EPSILON))
        kept = {running.step: running.since for running in here.running}
        assert kept.keys() <= found.plan.instance.keys()
        assert all(found.plan.instance[step].action == monitor.plan.instance[step].action for step in kept)
        assert not (found.plan.instance.keys() - kept.keys()) & monitor.plan.instance.keys(), "other identifiers"
        assert robust.check(found.plan).answer is robust.Answer.PROVED
        outcome = whole_run(monitor, found)
        assert outcome.valid, (seed, outcome.violations)
        continued = monitor.continued(found.plan, monitor.count)
        outlook = continued.outlook()
        assert outlook.prospect in {robust.Prospect.ON_TRACK, robust.Prospect.AT_RISK}
        assert {look.step: look.since for look in outlook.running} == kept
        assert all(look.start[0] >= here.time + remainder.planning_time for look in outlook.coming)
        count += 1
    assert count > 1


def test_of_several_plans_the_one_that_bears_most_is_taken():
    here = run_state(Monitor(workshop()))
    remainder = OpenProblem(DOMAIN, PROBLEM, here, Fraction(0), EPSILON, Fraction(150))
    settings = Settings(specs=SPECS, deadline=Fraction(150), epsilon=EPSILON)
    found = new_plan(remainder, OneByOne(0, 2, 1), None, settings)
    alone = [new_plan(remainder, OneByOne(pause), None, settings) for pause in (0, 1, 2)]
    assert found.found == 3
    assert found.bears.ratio == max(each.bears.ratio for each in alone)
    assert found.ends == min(each.ends for each in alone)


def test_the_function_asks_from_a_monitor_or_a_situation():
    monitor = Monitor(workshop(deadline=400))
    monitor.say("start", "n0", at=1)
    found = robust.replan(monitor, *FILES, planner=OneByOne(), planning_time="1/2")
    assert found.begins == Fraction(151, 100)
    assert {bound.name for bound in found.plan.constraints} == {None, "deadline"}
    alike = robust.replan(run_state(monitor), *FILES, planner=OneByOne(), planning_time="1/2", deadline=400)
    assert alike.plan == found.plan
    with pytest.raises(NoPlanError, match=r"\(in--time\) is false"):
        robust.replan(monitor, *FILES, planner=OneByOne(), deadline=60)


def test_durations_are_distributed_as_before():
    plan = workshop(deadline=400)
    chances = {
        parameter.name: Distribution("uniform", {"lower": parameter.nominal / 2, "upper": parameter.nominal * 2})
        for parameter in plan.parameters
    }
    monitor = Monitor(plan, distributions=chances)
    monitor.say("start", "n0", at=1)
    found = robust.replan(monitor, *FILES, planner=OneByOne())
    continued = monitor.continued(found.plan, monitor.count)
    by_action = {str(plan.instance[step]): chances[name] for name, step in plan.lasting.items()}
    wanted = {name: by_action.get(str(found.plan.instance[step])) for name, step in found.plan.lasting.items()}
    assert continued.distributions == {name: known for name, known in wanted.items() if known is not None}
    assert len(continued.distributions) > 3
    assert continued.outlook().success.lower == 0, "other workers take over, whose times nobody knows"
    same = monitor.continued(plan, monitor.count)
    assert same.distributions == chances
    assert same.outlook().success == monitor.outlook().success
    assert same.outlook().success.lower > 0
    some = dict(list(chances.items())[:-1])
    assert Monitor(plan, distributions=some).outlook().success.lower == 0, "of one duration nothing is known"


def test_identifiers_are_never_used_again():
    monitor, used = Monitor(workshop()), set()
    for number in range(3):
        monitor.say("start", monitor.outlook().startable[0].step, at=40 * number + 1)
        kept, used = {look.step for look in monitor.outlook().running}, used | monitor.plan.instance.keys()
        found = robust.replan(monitor, *FILES, planner=OneByOne(), planning_time=1)
        assert used & found.plan.instance.keys() == kept
        monitor = monitor.continued(found.plan, monitor.count)
        monitor.say("end", *kept, at=40 * number + 30)
        monitor.say("tick", at=40 * number + 40)


def test_texts_read_as_the_plan(tmp_path):
    monitor = Monitor(workshop())
    monitor.say("start", "n0", at=1)
    remainder = OpenProblem(DOMAIN, PROBLEM, run_state(monitor), Fraction(2), EPSILON)
    found = new_plan(remainder, OneByOne(), None, Settings(specs=SPECS, epsilon=EPSILON))
    names = {"domain": "d.pddl", "problem": "p.pddl", "plan": "plan.stn", "parameters": "plan.toml"}
    for what, name in names.items():
        (tmp_path / name).write_text(found.texts[what])
    read = robust.load_plan(*(tmp_path / names[what] for what in ("domain", "problem", "plan")))
    assert situation.read_again(*remainder.true, parse_stn(found.texts["plan"]), found.specs) == found.plan
    assert robust.check(read).answer is robust.Answer.PROVED
    assert read.constraints == found.plan.constraints


HEATING = """(define (domain heating) (:requirements :typing :durative-actions :fluents :timed-initial-literals)
 (:predicates (open) (warm) (done)) (:functions (fuel))
 (:durative-action heat :parameters () :duration (= ?duration 5)
  :condition (and (over all (open)) (at start (>= (fuel) 1)))
  :effect (and (at start (decrease (fuel) 1)) (at end (warm)) RATE))
 (:action finish :parameters () :precondition (warm) :effect (done)))"""
COLD = """(define (problem cold) (:domain heating)
 (:init (open) (= (fuel) 3) (at 4 (= (fuel) 9)) (at 60 (not (open)))) (:goal (done)))"""


def heating(tmp_path, rate=""):
    (tmp_path / "domain.pddl").write_text(HEATING.replace("RATE", rate))
    (tmp_path / "problem.pddl").write_text(COLD)
    (tmp_path / "plan.txt").write_text("5: (heat) [5]\n11: (finish)")
    return Monitor(
        robust.load_plan(
            *(tmp_path / name for name in ("domain.pddl", "problem.pddl", "plan.txt")), parameters=["duration:heat"]
        )
    )


def test_literals_that_have_passed_and_failures_are_part_of_the_state(tmp_path):
    monitor = heating(tmp_path)
    domain = parse_domain(HEATING.replace("RATE", ""))
    problem = parse_problem(COLD, domain)
    monitor.say("start", "n0", at=5)
    monitor.say("failed", "n0", at=7)
    here = run_state(monitor)
    assert {str(fluent): value for fluent, value in here.state.fluents.items()} == {"(fuel)": 8}, "9, and 1 was used"
    assert here.running == ()
    remainder = OpenProblem(domain, problem, here, Fraction(50), EPSILON)
    assert remainder.origin == Fraction(5701, 100)
    _, asked = remainder.asked
    assert [str(literal.time) for literal in asked.timed_literals] == ["299/100"]
    _, true = remainder.true
    assert [literal.time for literal in true.timed_literals] == [60]
    late = replace(remainder, planning_time=Fraction(60))
    assert "(open)" not in map(str, late.asked[1].atoms)
    assert late.origin > 67


def test_to_observe_what_an_action_changes_just_before_it_starts_breaks_nothing(tmp_path):
    """Observations are right after what happens at their time, and no time has to be kept from them."""
    monitor = heating(tmp_path)
    monitor.say("value", "fuel", observed=8, at=5)
    outlook = monitor.say("start", "n0", at=5)
    assert outlook.prospect is robust.Prospect.ON_TRACK, outlook.reasons
    monitor.say("value", "fuel", observed=7, at="5.0004")
    assert monitor.say("end", "n0", at=10).prospect is robust.Prospect.ON_TRACK


def test_literals_that_pass_are_no_news(tmp_path):
    monitor = heating(tmp_path)
    for time in (3, 4, "4.5"):
        outlook = monitor.say("tick", at=time)
        assert (outlook.prospect, outlook.reasons) == (robust.Prospect.ON_TRACK, ()), time
    late = monitor.say("tick", at=70)
    # Only what takes no time at all needs nothing while it lasts.
    assert (late.prospect, late.promise["n0"]) == (robust.Prospect.AT_RISK, (0, 0))


def test_what_cannot_be_planned_from_is_said(tmp_path):
    monitor = heating(tmp_path)
    monitor.say("start", "n0", at=5)
    domain = parse_domain(HEATING.replace("RATE", "(increase (fuel) (* #t 1))"))
    problem = parse_problem(COLD, domain)
    here = run_state(monitor)
    with pytest.raises(UnsupportedError, match="heat runs, which has continuous effects"):
        _ = OpenProblem(domain, problem, here, Fraction(0), EPSILON).asked
    with pytest.raises(UnsupportedError, match="an action runs twice at once"):
        OpenProblem(domain, problem, replace(here, running=here.running * 2), Fraction(0), EPSILON)
    with pytest.raises(NoPlanError, match="the deadline is over before another plan could begin"):
        _ = OpenProblem(DOMAIN, PROBLEM, replace(here, running=()), Fraction(3), EPSILON, Fraction(7)).asked
    with pytest.raises(NoPlanError, match="there is no planner"):
        new_plan(OpenProblem(DOMAIN, PROBLEM, replace(here, running=()), Fraction(3), EPSILON), None, None, Settings())
