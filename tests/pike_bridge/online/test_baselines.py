"""Kirk and Drake beside PIKE: re-plans and times by hand, and the same world for all."""

from collections import Counter
from fractions import Fraction
from itertools import product

import pytest

from benchmarks.generators.pike import k_intents
from benchmarks.pike.baselines import (
    Facts,
    Guesser,
    Kirk,
    Mode,
    Replanned,
    Script,
    ScriptedTeam,
    draw_script,
    execution_faults,
    kept_events,
    make_executive,
)
from robust.execute.drive import run_in_world
from robust.pike_bridge.action_model import Instance, load_team_plan
from robust.pike_bridge.builder import act, build, choose, parallel, sequence, within
from robust.pike_bridge.model import EPSILON, guard
from robust.pike_bridge.online.progress import Completion, Dispatched, Estimate, Failed, Outcome, Rejected, Succeeded
from robust.pike_bridge.online.reasoners import make_reasoner
from robust.pike_bridge.semantics import Existence, Oracle
from robust.plan.model import Atom
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem
from robust.smt.limits import Deadline, OutOfTimeError
from tests.pike_bridge.online.examples import KITCHEN

SMT = make_reasoner("smt")


class Recorder:
    """An executive whose decisions are kept."""

    def __init__(self, executive):
        self.executive = executive
        self.decisions = []

    def step(self, now, messages):
        found = self.executive.step(now, messages)
        self.decisions += found
        return found

    @property
    def wake(self):
        return self.executive.wake

    @property
    def ended(self):
        return self.executive.ended

    def of(self, kind):
        return [each for each in self.decisions if isinstance(each, kind)]


def run(plan, mode, script, *, recovery=None, notice=Fraction(0)):
    recorder = Recorder(make_executive(mode, plan, SMT, recovery=recovery or {}))
    run_in_world(recorder, ScriptedTeam(plan, recorder.executive, script, notice=notice))
    return recorder


def plan_of(name, element, predicates=(), actions=(), *, initial=()):
    texts = sketched_domain(name, predicates, actions), sketched_problem(name, name, initial, ())
    return Instance(build(name, element), *texts).plan()


def least(plan):
    """Every activity takes its least time."""
    return {(each.target, each.action): each.lower for each in plan.network.activities}


# -- one pair of choices, by hand ------------------------------------------------------------------------------------

# INITIAL, the choice, its branch, the branch's end, the merge, the robot's choice, branch, end, merge, GOAL. Everything
# but activities takes ε: six times ε from the start until the robot has finished, and GOAL's own distance.


@pytest.mark.parametrize(("human", "wrong"), [("1", 0), ("2", 1)])
def test_one_wrong_guess_costs_one_recovery(human, wrong):
    problem = k_intents([2])
    plan = problem.instance.plan()
    script = Script({"y1": human}, least(plan))
    pike, kirk = run(plan, Mode.PIKE, script), run(plan, Mode.KIRK, script, recovery=problem.recovery)
    lower = plan.network.activities[0].lower
    recovery = -(-lower / 2 // EPSILON) * EPSILON  # on the grid
    steps = pike.executive.outcome.time - 2 * lower
    assert steps % EPSILON == 0
    assert 0 < steps <= 10 * EPSILON
    assert kirk.executive.outcome.time == 2 * lower + steps + wrong * recovery
    assert (pike.executive.replans, kirk.executive.replans) == (0, wrong)
    assert kirk.executive.recovered == wrong * recovery
    assert execution_faults(plan, kirk.executive) == execution_faults(plan, pike.executive) == ()


def test_what_a_wrong_guess_does():
    problem = k_intents([2])
    plan = problem.instance.plan()
    kirk = run(plan, Mode.KIRK, Script({"y1": "2"}, least(plan)), recovery=problem.recovery)
    actions = [each.action for each in kirk.of(Dispatched)]
    assert actions == ["(h-1-1)", "(recover h-1-1)", "(h-1-2)", "(r-1-2)"]
    (replanned,) = kirk.of(Replanned)
    wrong, recovery, right, _ = kirk.of(Dispatched)
    assert replanned.abandoned == (("(h-1-1)", wrong.end),)
    assert replanned.time == wrong.time == recovery.time
    assert right.time == recovery.time + recovery.lower
    assert dict(kirk.executive.outcome.scenario) == {"y1": "2", "x1": "2"}


def test_free_recovery_costs_no_time():
    plan = k_intents([3, 2]).instance.plan()
    script = Script({"y1": "3", "y2": "2"}, least(plan))
    pike, kirk = run(plan, Mode.PIKE, script), run(plan, Mode.KIRK, script)
    assert kirk.executive.replans == 2
    assert kirk.executive.recovered == 0
    assert kirk.executive.outcome.time == pike.executive.outcome.time


# -- expectation and pairing -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("structure", [(2,), (3,), (2, 2), (3, 2)])
def test_replans_over_all_humans_are_as_probable_as_wrong_guesses(structure):
    """One guess against each human: as many re-plans as choices that differ, so Σ 1 − 1/N on average."""
    problem = k_intents(structure)
    plan = problem.instance.plan()
    names = [each.name for each in plan.network.choices if not each.controllable]
    humans = [
        dict(zip(names, values, strict=True)) for values in product(*(map(str, range(1, n + 1)) for n in structure))
    ]
    found = Counter()
    for human in humans:
        kirk = run(plan, Mode.KIRK, Script(human, least(plan)), recovery=problem.recovery).executive
        assert isinstance(kirk.outcome, Succeeded)
        assert kirk.replans == sum(value != "1" for value in human.values())  # guesses in the order of the plan
        found[kirk.replans] += 1
    expected = sum((1 - Fraction(1, n) for n in structure), Fraction(0))
    assert Fraction(sum(count * times for count, times in found.items()), len(humans)) == expected


@pytest.mark.parametrize("seed", range(6))
def test_kirk_is_later_by_its_recoveries(seed):
    """In this domain wrong guesses cost recovery and nothing else, so PIKE is never later."""
    structure = [(2, 3), (3, 3, 2), (2, 2, 2, 2)][seed % 3]
    problem = k_intents(structure, seed)
    plan = problem.instance.plan()
    script = draw_script(plan, seed)
    pike = run(plan, Mode.PIKE, script).executive
    paid = run(plan, Mode.KIRK, script, recovery=problem.recovery).executive
    free = run(plan, Mode.KIRK, script).executive
    assert paid.replans == free.replans
    assert free.outcome.time == pike.outcome.time == paid.outcome.time - paid.recovered
    assert execution_faults(plan, pike) == execution_faults(plan, paid) == ()


def test_all_meet_the_same_world():
    plan = k_intents([3, 2, 2], 5).instance.plan()
    script = draw_script(plan, 7)
    assert script == draw_script(plan, 7) != draw_script(plan, 8)
    for mode in (Mode.PIKE, Mode.KIRK):
        executive = run(plan, mode, script).executive
        assert {name: value for name, value in executive.outcome.scenario if name in script.outcomes} == script.outcomes
        times = executive.progress.times
        for each in plan.network.activities:
            if each.guard <= frozenset(executive.outcome.scenario):
                assert times[each.target] - times[each.source] == script.durations[each.target, each.action]


def test_draws_are_within_bounds_and_on_the_grid():
    plan = plan_of("drawn", sequence(act("(a)", 1, 2), act("(b)", 3, None)), actions=(ActionText("a"), ActionText("b")))
    for seed in range(20):
        durations = draw_script(plan, seed).durations
        for each in plan.network.activities:
            duration = durations[each.target, each.action]
            assert each.lower <= duration <= (each.upper or each.lower + 5)
            assert duration % EPSILON == 0


# -- guesses ---------------------------------------------------------------------------------------------------------


def test_the_first_guess_is_the_first_feasible_intent():
    plan = load_team_plan(KITCHEN)
    found = Guesser(plan).guess(Facts(), {}, Deadline())
    assert Oracle(plan).decide(guard(found)).verdict is Existence.EXISTS
    names = [each.name for each in plan.network.choices if not each.controllable]
    domains = plan.network.domains
    intents = (dict(zip(names, values, strict=True)) for values in product(*(domains[name] for name in names)))
    feasible = (each for each in intents if Oracle(plan).decide(guard(each)).verdict is Existence.EXISTS)
    assert {name: found[name] for name in names} == next(feasible)


def test_guesses_that_are_preferred_stay_if_they_may():
    guesser = Guesser(k_intents([2, 3]).instance.plan())
    facts = Facts(known=guard({"y1": "2"}))
    found = guesser.guess(facts, {"y1": "1", "x1": "1", "y2": "3", "x2": "3"}, Deadline())
    assert found == {"y1": "2", "x1": "2", "y2": "3", "x2": "3"}
    assert guesser.guess(Facts(known=guard({"y1": "2", "x1": "1"})), {}, Deadline()) is None


def test_another_order_of_guesses():
    plan = k_intents([3]).instance.plan()
    kirk = make_executive(Mode.KIRK, plan, SMT, ranking=lambda alternatives: list(reversed(alternatives)))
    assert kirk.assumed == {"y1": "3"}


# -- beyond the domain -----------------------------------------------------------------------------------------------


def two_ways(*, limit=None):
    """The human walks one of two ways while the robot drives; then the robot opens one of two doors."""
    walk = choose("way", {way: act(f"(walk-{way})", 2, 3, agent="human") for way in "ab"}, controllable=False)
    door = choose("door", {way: act(f"(open-{way})", 1, 2, agent="robot") for way in "ab"})
    actions = (
        ActionText("drive"),
        *(ActionText(f"walk-{way}", end_effects=(f"(at-{way})",)) for way in "ab"),
        *(ActionText(f"open-{way}", at_start=(f"(at-{way})",)) for way in "ab"),
    )
    whole = sequence(parallel(walk, act("(drive)", 4, 6, agent="robot")), door)
    return plan_of("two-ways", within(whole, upper=limit), ("(at-a)", "(at-b)"), actions)


def test_what_runs_beside_a_wrong_activity_goes_on():
    plan = two_ways()
    kirk = run(plan, Mode.KIRK, Script({"way": "b"}, least(plan)), recovery={"(walk-a)": Fraction(1)})
    assert [each.action for each in kirk.of(Dispatched)].count("(drive)") == 1
    assert kirk.executive.replans == 1
    assert execution_faults(plan, kirk.executive) == ()
    # The robot drives four units, in which one of recovery and two of walking fit.
    pike = run(plan, Mode.PIKE, Script({"way": "b"}, least(plan)))
    assert kirk.executive.outcome.time == pike.executive.outcome.time


def test_a_wrong_guess_that_is_seen_late_undoes_what_came_after_it():
    """The wrong walk and the wrong door are done when the choice is seen: both are undone, the last one first."""
    plan = two_ways()
    recovery = {"(walk-a)": Fraction(1), "(open-a)": Fraction(1, 2)}
    kirk = run(plan, Mode.KIRK, Script({"way": "b"}, least(plan)), recovery=recovery, notice=Fraction(9, 2))
    actions = [each.action for each in kirk.of(Dispatched)]
    assert actions[-4:] == ["(recover open-a)", "(recover walk-a)", "(walk-b)", "(open-b)"]
    assert kirk.executive.recovered == Fraction(3, 2)
    assert actions.count("(drive)") == 1
    assert execution_faults(plan, kirk.executive) == ()


def test_recovery_that_takes_too_long_fails():
    plan = two_ways(limit=6)
    script = Script({"way": "b"}, least(plan))
    assert isinstance(run(plan, Mode.KIRK, script, recovery={"(walk-a)": Fraction(1)}).executive.outcome, Succeeded)
    slow = run(plan, Mode.KIRK, script, recovery={"(walk-a)": Fraction(3)}).executive
    assert isinstance(slow.outcome, Failed)
    assert slow.replans == 0
    assert isinstance(run(plan, Mode.PIKE, script).executive.outcome, Succeeded)


def test_what_was_done_for_a_guess_commits():
    """The robot has fetched for the guess before the human chooses: nothing undoes it, and Kirk fails. PIKE waits."""
    fetch = choose("fetched", {item: act(f"(fetch-{item})", 1, 2, agent="robot") for item in "ab"})
    use = choose("used", {item: act(f"(use-{item})", 1, 2, agent="human") for item in "ab"}, controllable=False)
    actions = (
        *(ActionText(f"fetch-{item}", end_effects=(f"(have-{item})",)) for item in "ab"),
        *(ActionText(f"use-{item}", at_start=(f"(have-{item})",)) for item in "ab"),
    )
    plan = plan_of("fetch", sequence(fetch, use), ("(have-a)", "(have-b)"), actions)
    kirk = run(plan, Mode.KIRK, Script({"used": "b"}, least(plan))).executive
    assert isinstance(kirk.outcome, Failed)
    assert kirk.outcome.reason == "no candidate is left that agrees with what has happened"


def test_events_that_come_too_early_are_undone_with_what_is_wrong():
    plan = two_ways()
    old = guard({"way": "a", "door": "a"})
    begun = [each for each in plan.network.activities if each.guard <= old]
    times = {name: Fraction(1) for name, label in plan.network.guards.items() if label <= old}
    kept = kept_events(plan, times, begun, {"way": "b"})
    drive = next(each for each in begun if each.action == "(drive)")
    opened = next(each for each in begun if each.action == "(open-a)")
    walked = next(each for each in begun if each.action == "(walk-a)")
    assert {drive.source, drive.target} <= kept.keys()
    assert not {walked.source, walked.target, opened.source, opened.target} & kept.keys()
    assert kept_events(plan, times, begun, {"way": "a"}) == times


@pytest.mark.parametrize("seed", range(4))
def test_a_broken_link_makes_kirk_guess_anew(seed):
    """Two guesses about the doors are feasible; what is seen excludes the first, and nothing was done for it."""
    doors = choose("door", {door: act(f"(take-{door})", 1, 2, agent="robot") for door in "ab"})
    actions = (ActionText("wait"), *(ActionText(f"take-{door}", at_start=(f"(free-{door})",)) for door in "ab"))
    free = ("(free-a)", "(free-b)")
    plan = plan_of("doors", sequence(act("(wait)", 2, 3), doors), free, actions, initial=free)
    kirk = Recorder(make_executive(Mode.KIRK, plan, SMT))
    world = ScriptedTeam(plan, kirk.executive, draw_script(plan, seed))
    blocked = Estimate(false=frozenset({Atom("free-a")}))
    world._plan_for(Fraction(1), blocked)
    run_in_world(kirk, world)
    assert isinstance(kirk.executive.outcome, Succeeded)
    assert kirk.executive.replans == 1
    assert [each.action for each in kirk.of(Dispatched)] == ["(wait)", "(take-b)"]


def test_a_choice_that_changes_during_recovery_does_not_end_it():
    """Two humans choose otherwise, one a moment after the other: the second recovery comes before the rest."""
    ways = parallel(
        *(
            choose(who, {way: act(f"(walk-{who}-{way})", 2, 3, agent=who) for way in "ab"}, controllable=False)
            for who in ("ann", "bob")
        )
    )
    actions = tuple(ActionText(f"walk-{who}-{way}") for who in ("ann", "bob") for way in "ab")
    plan = plan_of("walks", ways, (), actions)
    kirk = Recorder(Kirk(plan, SMT, recovery={f"(walk-{who}-a)": Fraction(1) for who in ("ann", "bob")}))
    world = ScriptedTeam(plan, kirk.executive, Script({"ann": "b"}, least(plan)))
    world._plan_for(Fraction(1, 2), Outcome("bob", "b"))
    end = run_in_world(kirk, world)
    first, second = kirk.of(Replanned)
    assert second.time == Fraction(1, 2)
    assert second.recovery == 1 + first.time + first.recovery - second.time
    assert kirk.executive.recovered == 2
    assert isinstance(kirk.executive.outcome, Succeeded)
    assert end >= first.time + 2 + 2
    assert execution_faults(plan, kirk.executive) == ()


# -- Drake -----------------------------------------------------------------------------------------------------------


def test_drake_pours_coffee_that_nobody_made():
    """The human takes the glass and yet pours coffee in time: PIKE sees that it needs the mug, Drake does not."""
    plan = load_team_plan(KITCHEN)
    outcomes = {"xA1": "glass", "xA2": "coffee", "xA3": "cereal", "xA4": "cereal"}
    script = Script(outcomes, least(plan))
    drake = run(plan, Mode.DRAKE, script).executive
    assert isinstance(drake.outcome, Succeeded)
    assert any("needs (have mug)" in fault for fault in execution_faults(plan, drake))
    pike = run(plan, Mode.PIKE, script).executive
    assert isinstance(pike.outcome, Failed)
    assert pike.outcome.time < drake.outcome.time


def test_drake_does_not_adapt_where_pike_does():
    """The human does what is right; who ignores causes fetches the first thing, and not what is needed."""
    plan = k_intents([2]).instance.plan()
    script = Script({"y1": "2"}, least(plan))
    pike, drake = run(plan, Mode.PIKE, script).executive, run(plan, Mode.DRAKE, script).executive
    assert execution_faults(plan, pike) == ()
    assert any("needs (p-1-1)" in fault for fault in execution_faults(plan, drake))


# -- faults ----------------------------------------------------------------------------------------------------------


def test_a_plan_without_correct_execution():
    plan = two_ways(limit=3)
    for mode in (Mode.PIKE, Mode.KIRK):
        executive = make_executive(mode, plan, SMT)
        assert not executive.prepare()
        assert isinstance(executive.step(Fraction(0))[-1], Failed)
    assert execution_faults(plan, executive) == ()


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (Outcome("x9", "1"), "there is no choice"),
        (Outcome("y1", "9"), "expected one of 1, 2"),
        (Outcome("x1", "1"), "for the executive to choose"),
        (Completion("(h-1-1)"), "not running"),
        (Completion("(fly)"), "no such activity"),
    ],
    ids=["unknown choice", "unknown value", "not theirs", "not running", "unknown activity"],
)
def test_messages_that_make_no_sense_are_rejected(message, reason):
    kirk = Kirk(k_intents([2]).instance.plan(), SMT)
    (rejected,) = [each for each in kirk.step(Fraction(0), [message]) if isinstance(each, Rejected)]
    assert reason in rejected.reason
    assert kirk.replans == 0


def test_an_outcome_counts_once():
    kirk = Kirk(k_intents([2]).instance.plan(), SMT)
    kirk.step(Fraction(0), [Outcome("y1", "2")])
    assert kirk.replans == 1
    found = kirk.step(Fraction(0), [Outcome("y1", "2"), Outcome("y1", "1")])
    assert [each.reason for each in found if isinstance(each, Rejected)] == [
        "known already",
        "y1 = 2 was observed before",
    ]
    assert kirk.recovered == 0  # nothing had begun
    assert kirk.assumed == {}


def test_nothing_counts_after_the_end():
    kirk = Kirk(two_ways(limit=3), SMT)
    kirk.step(Fraction(0))
    (rejected,) = kirk.step(Fraction(1), [Outcome("way", "a")])
    assert "has ended" in rejected.reason
    assert kirk.wake is None


def test_a_passed_deadline():
    with pytest.raises(OutOfTimeError):
        Kirk(k_intents([2]).instance.plan(), SMT, deadline=Deadline.after(0))
