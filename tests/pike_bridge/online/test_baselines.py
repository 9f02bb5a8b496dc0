"""Kirk and Drake beside PIKE: re-plans and times by hand, and the same world for all."""

from fractions import Fraction

import pytest

from benchmarks.pike import baselines
from benchmarks.pike.baselines import Mode, Script, ScriptedTeam, draw_script
from robust import pike
from robust.pike import Oracle, act, build, choose, k_intents, make_reasoner, parallel, run_in_world, sequence, within
from robust.pike_bridge.action_model import Instance, load_team_plan, shipped
from robust.pike_bridge.model import EPSILON, guard
from robust.pike_bridge.online import kirk as guessing
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.kirk import Kirk
from robust.pike_bridge.online.kirk_world import execution_faults
from robust.plan.model import Atom
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem
from robust.smt.limits import Deadline, OutOfTimeError
from tests.cli.running import answer_of, command
from tests.pike_bridge.online.examples import KITCHEN, exists, joint_values

SMT = make_reasoner("smt")


class Recorder:
    """An executive whose decisions are kept."""

    def __init__(self, executive):
        self.executive, self.decisions = executive, []

    def __getattr__(self, name):
        return getattr(self.executive, name)

    def step(self, now, messages):
        decisions = self.executive.step(now, messages)
        self.decisions += decisions
        return decisions

    def of(self, kind):
        return [each for each in self.decisions if isinstance(each, kind)]

    @property
    def actions(self):
        return [each.action for each in self.of(said.Dispatched)]


def intents(*arguments):
    """A plan of the family, and how long it takes to recover from activities."""
    problem = k_intents(*arguments)
    return problem.instance.plan(), problem.recovery


def run(plan, mode, script, *, recovery=None, notice=Fraction(0)):
    recorder = Recorder(baselines.make_executive(mode, plan, SMT, recovery=recovery or {}))
    run_in_world(recorder, ScriptedTeam(plan, recorder, script, notice=notice))
    return recorder


def plan_of(name, element, predicates=(), actions=(), *, initial=()):
    texts = sketched_domain(name, predicates, actions), sketched_problem(name, name, initial, ())
    return Instance(build(name, element), *texts).plan()


def least(plan):
    """Every activity takes its least time."""
    return {(each.target, each.action): each.lower for each in plan.network.activities}


def test_draws_and_what_guesses_and_wrong_ones_do():
    plan, recoveries = intents([2])
    kirk = run(plan, Mode.KIRK, Script({"y1": "2"}, least(plan)), recovery=recoveries)
    assert kirk.recovered == -(-recoveries["(h-1-1)"] // EPSILON) * EPSILON  # on the grid
    assert kirk.actions == ["(h-1-1)", "(recover h-1-1)", "(h-1-2)", "(r-1-2)"]
    (replanned,) = kirk.of(guessing.Replanned)
    wrong, recovery, right, _ = kirk.of(said.Dispatched)
    assert replanned.abandoned == (("(h-1-1)", wrong.end),)
    assert replanned.time == wrong.time == recovery.time
    assert right.time == recovery.time + recovery.lower
    assert dict(kirk.outcome.scenario) == {"y1": "2", "x1": "2"}
    plan = plan_of("drawn", sequence(act("(a)", 1, 2), act("(b)", 3, None)), actions=(ActionText("a"), ActionText("b")))
    for seed in range(20):
        durations = draw_script(plan, seed).durations
        for each in plan.network.activities:
            duration = durations[each.target, each.action]
            assert each.lower <= duration <= (each.upper or each.lower + 5)
            assert duration % EPSILON == 0
    plan = load_team_plan(KITCHEN)
    guess, oracle = guessing.Guesser(plan).guess(guessing.Facts(), {}, Deadline()), Oracle(plan)
    assert exists(oracle.decide(guard(guess)))
    assert next(each for each in joint_values(plan) if exists(oracle.decide(guard(each)))).items() <= guess.items()
    # Those that are preferred stay if they may.
    guesser = guessing.Guesser(intents([2, 3])[0])
    facts = guessing.Facts(known=guard({"y1": "2"}))
    guess = guesser.guess(facts, {"y1": "1", "x1": "1", "y2": "3", "x2": "3"}, Deadline())
    assert guess == {"y1": "2", "x1": "2", "y2": "3", "x2": "3"}
    assert guesser.guess(guessing.Facts(known=guard({"y1": "2", "x1": "1"})), {}, Deadline()) is None
    backwards = guessing.Guesser(k_intents([3]).instance.plan(), ranking=lambda values: list(reversed(values)))
    assert backwards.guess(guessing.Facts(), {}, Deadline())["y1"] == "3"


@pytest.mark.parametrize("structure", [(2,), (3,), (2, 2), (3, 2)])
def test_there_are_as_many_replans_as_wrong_guesses(structure):
    """One guess against each human: so Σ 1 − 1/N on average over all humans."""
    plan, recovery = intents(structure)
    for human in joint_values(plan):
        kirk = run(plan, Mode.KIRK, Script(human, least(plan)), recovery=recovery)
        assert isinstance(kirk.outcome, said.Succeeded)
        assert kirk.replans == sum(value != "1" for value in human.values())  # guesses in the order of the plan


@pytest.mark.parametrize("seed", range(6))
def test_kirk_is_later_by_its_recoveries_in_the_same_world(seed):
    """In this domain wrong guesses cost recovery and nothing else, so PIKE is never later."""
    plan, recovery = intents([(2, 3), (3, 3, 2), (2, 2, 2, 2)][seed % 3], seed)
    script = draw_script(plan, seed)
    assert script == draw_script(plan, seed) != draw_script(plan, seed + 1)
    pike, free = run(plan, Mode.PIKE, script), run(plan, Mode.KIRK, script)
    paid = run(plan, Mode.KIRK, script, recovery=recovery)
    assert (paid.replans, free.recovered) == (free.replans, 0)
    assert free.outcome.time == pike.outcome.time == paid.outcome.time - paid.recovered
    assert execution_faults(plan, pike) == execution_faults(plan, paid) == ()
    for executive in (pike, free):
        scenario, times = dict(executive.outcome.scenario), executive.progress.times
        assert scenario.items() >= script.outcomes.items()
        for each in plan.network.activities:
            if each.guard <= scenario.items():
                assert times[each.target] - times[each.source] == script.durations[each.target, each.action]


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
    script = Script({"way": "b"}, least(plan))
    kirk, pike = run(plan, Mode.KIRK, script, recovery={"(walk-a)": Fraction(1)}), run(plan, Mode.PIKE, script)
    assert (kirk.actions.count("(drive)"), kirk.replans) == (1, 1)
    assert execution_faults(plan, kirk) == ()
    # The robot drives four units, in which one of recovery and two of walking fit.
    assert kirk.outcome.time == pike.outcome.time
    # A wrong walk and a wrong door that are done when the choice is seen are both undone, the last one first.
    recovery = {"(walk-a)": Fraction(1), "(open-a)": Fraction(1, 2)}
    late = run(plan, Mode.KIRK, script, recovery=recovery, notice=Fraction(9, 2))
    assert late.actions[-4:] == ["(recover open-a)", "(recover walk-a)", "(walk-b)", "(open-b)"]
    assert (late.actions.count("(drive)"), late.recovered) == (1, Fraction(3, 2))
    assert execution_faults(plan, late) == ()


def test_recovery_may_take_too_long_and_what_was_done_for_a_guess_is_undone():
    """The robot has fetched for the guess before the human chooses: it takes that back [PIKE, Example 6.1]."""
    plan = two_ways(limit=6)
    endings = {
        (Mode.KIRK, 1): (said.Succeeded, 1),
        (Mode.KIRK, 3): (said.Failed, 0),
        (Mode.PIKE, 3): (said.Succeeded, 0),
    }
    for (mode, recovery), ending in endings.items():
        record = run(plan, mode, Script({"way": "b"}, least(plan)), recovery={"(walk-a)": Fraction(recovery)})
        assert (type(record.outcome), record.replans) == ending
    fetch = choose("fetched", {item: act(f"(fetch-{item})", 1, 2, agent="robot") for item in "ab"})
    use = choose("used", {item: act(f"(use-{item})", 1, 2, agent="human") for item in "ab"}, controllable=False)
    actions = (
        *(ActionText(f"fetch-{item}", end_effects=(f"(have-{item})",)) for item in "ab"),
        *(ActionText(f"use-{item}", at_start=(f"(have-{item})",)) for item in "ab"),
    )
    recovery = {"(fetch-a)": Fraction(2), "(use-a)": Fraction(1)}
    for limit, ending in ((None, said.Succeeded), (6, said.Failed)):
        plan = plan_of("fetch", within(sequence(fetch, use), upper=limit), ("(have-a)", "(have-b)"), actions)
        kirk = run(plan, Mode.KIRK, Script({"used": "b"}, least(plan)), recovery=recovery)
        assert isinstance(kirk.outcome, ending)
    assert kirk.outcome.reason == "no candidate is left that agrees with what has happened"
    plan = plan_of("fetch", sequence(fetch, use), ("(have-a)", "(have-b)"), actions)
    kirk = run(plan, Mode.KIRK, Script({"used": "b"}, least(plan)), recovery=recovery)
    assert kirk.actions == ["(fetch-a)", "(use-a)", "(recover use-a)", "(recover fetch-a)", "(fetch-b)", "(use-b)"]
    assert (kirk.replans, kirk.recovered, execution_faults(plan, kirk)) == (1, 3, ())


@pytest.mark.parametrize("seed", range(4))
def test_a_broken_link_makes_kirk_guess_anew(seed):
    """Two guesses about the doors are feasible; what is seen excludes the first, and nothing was done for it."""
    doors = choose("door", {door: act(f"(take-{door})", 1, 2, agent="robot") for door in "ab"})
    actions = (ActionText("wait"), *(ActionText(f"take-{door}", at_start=(f"(free-{door})",)) for door in "ab"))
    free = ("(free-a)", "(free-b)")
    plan = plan_of("doors", sequence(act("(wait)", 2, 3), doors), free, actions, initial=free)
    kirk = Recorder(baselines.make_executive(Mode.KIRK, plan, SMT))
    world = ScriptedTeam(plan, kirk, draw_script(plan, seed))
    world._plan_for(Fraction(1), said.Estimate(false=frozenset({Atom("free-a")})))
    run_in_world(kirk, world)
    assert isinstance(kirk.outcome, said.Succeeded)
    assert (kirk.replans, kirk.actions) == (1, ["(wait)", "(take-b)"])


def test_a_choice_that_changes_during_recovery_does_not_end_it():
    """Two humans choose otherwise, one a moment after the other: the second recovery comes before the rest."""
    branches = {who: {way: act(f"(walk-{who}-{way})", 2, 3, agent=who) for way in "ab"} for who in ("ann", "bob")}
    ways = parallel(*(choose(who, each, controllable=False) for who, each in branches.items()))
    actions = tuple(ActionText(f"walk-{who}-{way}") for who in ("ann", "bob") for way in "ab")
    plan = plan_of("walks", ways, (), actions)
    kirk = Recorder(Kirk(plan, SMT, recovery={f"(walk-{who}-a)": Fraction(1) for who in ("ann", "bob")}))
    world = ScriptedTeam(plan, kirk, Script({"ann": "b"}, least(plan)))
    world._plan_for(Fraction(1, 2), said.Outcome("bob", "b"))
    end = run_in_world(kirk, world)
    first, second = kirk.of(guessing.Replanned)
    assert second.time == Fraction(1, 2)
    assert second.recovery == 1 + first.time + first.recovery - second.time
    assert kirk.recovered == 2
    assert isinstance(kirk.outcome, said.Succeeded)
    assert end >= first.time + 2 + 2
    assert execution_faults(plan, kirk) == ()


def test_no_correct_execution_events_that_come_too_early_and_messages_that_make_no_sense():
    plan = two_ways(limit=3)
    for mode in (Mode.PIKE, Mode.KIRK):
        executive = baselines.make_executive(mode, plan, SMT)
        assert not executive.prepare()
        assert isinstance(executive.step(Fraction(0))[-1], said.Failed)
    assert execution_faults(plan, executive) == ()
    plan = two_ways()
    old = guard({"way": "a", "door": "a"})
    begun = [each for each in plan.network.activities if each.guard <= old]
    times = {name: Fraction(1) for name, label in plan.network.guards.items() if label <= old}
    kept = guessing.kept_events(plan, times, begun, {"way": "b"})
    ends = {(each.action, end in kept) for each in begun for end in (each.source, each.target)}
    assert ends == {("(drive)", True), ("(open-a)", False), ("(walk-a)", False)}
    assert guessing.kept_events(plan, times, begun, {"way": "a"}) == times

    def rejections(kirk, now, *messages):
        return [each.reason for each in kirk.step(Fraction(now), messages) if isinstance(each, said.Rejected)]

    plan = intents([2])[0]
    for message, reason in (
        (said.Outcome("x9", "1"), "there is no choice 'x9'"),
        (said.Outcome("y1", "9"), "expected one of 1, 2"),
        (said.Outcome("x1", "1"), "x1 is for the executive to choose"),
        (said.Completion("(h-1-1)"), "it is not running"),
        (said.Completion("(fly)"), "there is no such activity"),
    ):
        kirk = Kirk(plan, SMT)
        assert (rejections(kirk, 0, message), kirk.replans) == ([reason], 0)
    assert rejections(kirk, 0, said.Outcome("y1", "2")) == []
    assert (kirk.replans, kirk.recovered, kirk.assumed) == (1, 0, {})  # nothing had begun
    reasons = rejections(kirk, 0, said.Outcome("y1", "2"), said.Outcome("y1", "1"))
    assert reasons == ["known already", "y1 = 2 was observed before"]
    kirk = Kirk(two_ways(limit=3), SMT)
    kirk.step(Fraction(0))
    assert (rejections(kirk, 1, said.Outcome("way", "a")), kirk.wake) == (["the execution has ended"], None)
    with pytest.raises(OutOfTimeError):
        Kirk(plan, SMT, deadline=Deadline.after(0))


@pytest.mark.parametrize("structure", [(2,), (3, 2)])
def test_rehearsals_with_kirk_come_to_what_scripts_do(structure):
    """People who choose the same, and activities of the same lengths, in both worlds: the same re-plans and times."""
    plan, recovery = intents(structure)
    for human in joint_values(plan):
        scripted = run(plan, Mode.KIRK, Script(human, least(plan)), recovery=recovery)
        record = pike.run(plan, reasoner="kirk", outcome=human, pace="least")
        assert (record.ending, record.reasoner, record.backend) == (pike.Ending.SUCCEEDED, "kirk", "smt")
        assert (record.time, record.replans) == (scripted.outcome.time, scripted.replans)
        assert record.recovered == scripted.recovered
        assert record.choices == dict(scripted.outcome.scenario)
        guesses = [step.guess for step in record.steps if step.guess]
        assert len(guesses) == 1 + record.replans
        assert guesses[-1] == record.choices
    free = pike.run(plan, reasoner="kirk", outcome=human, pace="least", recovery=0)
    assert (free.replans, free.recovered) == (record.replans, 0)
    assert free.time == record.time - record.recovered


@pytest.mark.parametrize("pace", ["cooperative", "random"])
@pytest.mark.parametrize("seed", range(3))
def test_kirk_with_a_simulated_team(seed, pace):
    """Whatever it takes for a success is one, which the run checks; rational people choose what is left."""
    for instance in (k_intents((2, 3), seed).instance, shipped("wing")):
        careless = pike.run(instance, reasoner="kirk", human="careless", pace=pace, seed=seed, delay=1)
        assert careless.ending in {pike.Ending.SUCCEEDED, pike.Ending.FAILED}
    kitchen = pike.run(KITCHEN, reasoner="kirk", pace="cooperative", seed=seed)
    assert kitchen.ending is pike.Ending.SUCCEEDED
    assert exists(Oracle(load_team_plan(KITCHEN)).decide(guard(kitchen.choices)))
    juice = pike.run(KITCHEN, reasoner="kirk", outcome={"xA1": "glass"}, seed=seed)
    assert (juice.ending, juice.choices["xR1"], juice.recovered > 0) == (pike.Ending.SUCCEEDED, "juice", True)
    broken = pike.run(KITCHEN, reasoner="kirk", disturb="(not (in-place cereal))@1", seed=seed)
    assert broken.replans + (broken.ending is pike.Ending.FAILED) > 0


def test_what_stops_is_told_and_options_that_kirk_does_not_have(tmp_path):
    file = k_intents((2,)).instance.write(tmp_path)
    words = ("pike", "run", file, "--reasoner", "kirk", "--outcome", "y1=2", "--seed", "1")
    text = command(*words).out.splitlines()
    assert text[0].endswith("1 re-plan, recovery took 0.661")
    told = [line.split()[1:3] for line in text[1:]]
    assert told[:6] == [
        ["guess", "y1"],
        ["begin", "human:"],
        ["observed", "y1"],
        ["cancel", "human:"],
        ["resumed", "another"],
        ["begin", "human:"],
    ]
    answer = answer_of(command(*words, "--json"), "robust/pike-run/1")
    assert (answer["replans"], answer["steps"][0]["guess"]) == (1, {"y1": "1", "x1": "1"})
    for more, message in (
        (("--explain",), "--explain: cannot be combined with --reasoner kirk"),
        (("--budget", "1"), "--budget: cannot be combined with --reasoner kirk"),
        (("--reasoner", "smt", "--recovery", "1"), "--recovery: needs --reasoner kirk"),
        (("--stdio",), "expected without: nothing is simulated then"),
    ):
        assert message in command(*words, *more).err
    assert "found kirk together with --stdio" in command("pike", "run", file, "--reasoner", "kirk", "--stdio").err
