"""The executive, step by step against the semantic oracle; what it makes of faults; and the reasons that are given."""

from fractions import Fraction
from itertools import combinations

import pytest

from robust.errors import InputError
from robust.pike import PlanExecutive, act, build, parallel, sequence, within
from robust.pike_bridge.model import EPSILON, Assignment, Constraint, TeamPlan, guard
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online import reasoners
from robust.pike_bridge.online.continuations import Alike, Continuation
from robust.pike_bridge.online.explain import About, Situation, conflict
from robust.pike_bridge.online.inquiry import Inquiry, Obstacle, WhyChosen, WhyNot, why, why_failed, why_none, why_not
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Ending, Human, Pace, Rehearsal, SimulatedTeam, Story
from robust.pike_bridge.semantics import Execution, Oracle, faults
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Satisfiability, Session
from tests.pike_bridge import stories
from tests.pike_bridge.online import examples
from tests.pike_bridge.online.examples import BROKEN, MUG, SOLVABLE, TOASTER, drawn, fetching, kitchen, started, tale

STORIES = (Story(), Story(human=Human.CARELESS), Story(pace=Pace.RANDOM), Story(delay=Fraction(3)))
MUG_CHOSEN = said.Outcome("xA1", "mug")


@pytest.mark.parametrize(
    ("index", "stories"),
    [
        *((None, [story]) for story in STORIES),
        *((each, STORIES[:1]) for each in SOLVABLE[:1]),
        *(pytest.param(each, STORIES * 2, marks=pytest.mark.slow) for each in (None, *SOLVABLE)),
    ],
)
def test_executions_stay_correct_until_they_fail(index, stories):
    plan = kitchen() if index is None else drawn(index)
    for seed, story in enumerate(stories):
        asked, executive = [], PlanExecutive(plan, SemanticReasoner)
        examples.watch(executive, examples.confirming(plan, asked), story=story, seed=seed)
        succeeded = isinstance(executive.outcome, said.Succeeded)
        assert asked
        assert story != Story() or (succeeded if index is None else executive.outcome is not None)
        if succeeded:
            scenario = {name: domain[0] for name, domain in plan.network.domains.items()} | executive.progress.chosen
            assert faults(plan, Execution(scenario, executive.progress.times)) == ()


class Abridged(SemanticReasoner):
    """Asks a second time when something is executable first, without what the witness says."""

    whole = False

    def _earliest_execution(self, deadline, withheld=()):
        earliest = super()._earliest_execution(deadline, withheld)
        self.whole = True
        assert super()._earliest_execution(deadline, withheld) == earliest
        self.whole = False
        return earliest

    def _executes_at(self, event, moment):
        return not self.whole and super()._executes_at(event, moment)


@pytest.mark.parametrize(("solvers", "index"), [(("cvc5",), None), ((), None), ((), SOLVABLE[0])])
def test_answers_do_not_depend_on_the_solver_or_on_a_witness(solvers, index):
    def two_solvers(progress):
        return examples.Compared(SemanticReasoner(progress), SemanticReasoner(progress, solver=solvers[0]))

    executive = PlanExecutive(kitchen() if index is None else drawn(index), two_solvers if solvers else Abridged)
    outcome = examples.watch(executive, judge=SemanticReasoner(executive.progress), seed=1)
    assert (type(outcome), len(executive.progress.times) > 5) == (said.Succeeded, True)


def test_a_witness_shows_only_what_is_executable_by_a_whole_epsilon():
    """A message half of ε after a moment is not strictly after it."""
    late = Fraction("2.0005")
    plan = examples.working(Constraint("begin", "own", Fraction(2), None), most=late)
    reasoner = SemanticReasoner(said.Progress(plan, Fraction(2), {"begin": Fraction(0)}))
    assert not reasoner.executable("own", NEVER)
    known = Execution({}, {"begin": Fraction(0), "own": Fraction(2), "end": late})
    reasoner._witness = Continuation({}, known.schedule, Alike(reasoner.progress, known, ()))
    assert not reasoner.executable("own", NEVER)
    assert reasoner.possible(NEVER)


def rejected(executive, now, *messages):
    """Why the executive rejects a message, of which there is one."""
    [reason] = [each.reason for each in executive.step(Fraction(now), messages) if isinstance(each, said.Rejected)]
    return reason


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (said.Outcome("xA9", "mug"), "there is no choice 'xA9'"),
        (said.Outcome("xA1", "bucket"), "expected one of mug, glass"),
        (said.Outcome("xR1", "grounds"), "xR1 is for the executive to choose"),
        (said.Completion("(fly human)"), "there is no such activity"),
        (said.Completion("(get human mug)"), "it is not running"),
        (said.Estimate(true=frozenset({TOASTER}), false=frozenset({TOASTER})), "is said to be both true and false"),
    ],
    ids=str,
)
def test_messages_that_make_no_sense_change_nothing(message, reason):
    executive = started()
    before = executive.progress.copy()
    assert reason in rejected(executive, before.now, message)
    assert executive.progress == before
    assert not executive.ended


def test_an_activity_that_never_ends_is_noticed_and_the_same_action_may_run_twice_at_a_time():
    """And a clock that goes back stands still; and nothing counts after the end."""
    running = fetching()
    begun = running.progress.now
    assert "went back" in rejected(running, 0)
    assert running.progress.now == begun
    while not running.ended:
        running.step(running.wake)
    assert isinstance(running.outcome, said.Failed)
    assert running.outcome.time == begun + 2 + EPSILON
    assert rejected(running, 1001, MUG_CHOSEN) == "the execution has ended"
    plan = without_conditions(parallel(act("(a)", 1, 9), act("(a)", 2, 9)))
    executive = PlanExecutive(plan, SemanticReasoner)
    assert executive.prepare()
    first, second = (each.target for each in plan.network.activities)
    for now in range(4):
        executive.step(Fraction(now))
    assert sorted(executive.running) == [0, 1]
    assert rejected(executive, 3, said.Completion("(a)")) == "several run; say at which event it ends"
    assert rejected(executive, 3, said.Completion("(a)", "e99")) == "there is no such activity"
    for told, event, left in ({"goal": said.goal_of(1)}, second, [0]), ({"event": first}, first, []):
        decisions = executive.step(Fraction(4), [said.Completion("(a)", **told)])
        assert decisions[0] == said.Executed(event, Fraction(4), reported=True)
        assert sorted(executive.running) == left


def test_reasoners_learn_each_fact_once():
    learned = []

    class Learning(SemanticReasoner):
        def _learn(self, news):
            learned.append(news)
            super()._learn(news)

    executive = started(None, Learning, MUG_CHOSEN)
    executive.step(Fraction(1, 1000), [said.Estimate(false=frozenset({TOASTER}))])
    executive.step(Fraction(1, 2000))
    executive.reasoner.catch_up()
    progress = executive.progress
    assert [each.later for each in learned] == [True, False, True, *[False] * (len(learned) - 3)]
    assert dict(item for each in learned for item in each.times.items()) == progress.times
    assert [each for news in learned for each in news.chosen] == [Assignment(*each) for each in progress.chosen.items()]
    assert any(news.void for news in learned)
    assert frozenset().union(*(each.void for each in learned)) == progress.void


def test_possible_values_and_conflicts_of_a_moment():
    executive, oracle = started(), Oracle(kitchen())
    progress = executive.progress
    for choice in kitchen().network.choices:
        chosen = [(value, guard(progress.chosen | {choice.name: value})) for value in choice.domain]
        answers = ((value, oracle.decide(each, progress.times, now=progress.now)) for value, each in chosen)
        expected = tuple(value for value, answer in answers if examples.exists(answer))
        assert executive.possible_values(choice.name) == expected
    executive = PlanExecutive(kitchen(), SemanticReasoner)
    inquiry = Inquiry(executive.progress)
    executive.step(Fraction(0))
    executive.step(Fraction(1, 1000), [MUG_CHOSEN])
    assert inquiry.why_not_assignment(Assignment("xA2", "juice")).obstacle is Obstacle.NONE
    executive = PlanExecutive(drawn(1), SemanticReasoner)
    assert isinstance(executive.step(Fraction(0))[-1], said.Failed)
    assert conflict(executive.progress) == ()


# Teams cooperate: PIKE counts on them, so with them a plan that admits a correct execution has one.


def without_conditions(element):
    return TeamPlan(build("small", element), (), ())


def cooperates(plan, seed):
    return Rehearsal(plan, Story(), seed=seed, infer=False).run().ending is Ending.SUCCEEDED


@pytest.mark.parametrize(
    ("index", "seeds"),
    [(26, [26]), *(pytest.param(each, range(10), marks=pytest.mark.slow) for each in (122, *SOLVABLE))],
)
def test_drawn_plans_succeed_with_every_luck(index, seeds):
    """Number 26 has activities that must end before others can, and both have bounds that ε does not divide."""
    assert all(cooperates(drawn(index), seed) for seed in seeds)


@pytest.mark.parametrize("takes", [Fraction("2.00025"), None])
def test_a_limit_between_two_multiples_of_epsilon_can_be_used_up_and_not_more(takes):
    class Slow(SimulatedTeam):
        """Takes as long as told for everything; None: never ends anything."""

        def receive(self, now, decisions):
            if takes is not None:
                super().receive(now, decisions)

        def _begin(self, now, activity):
            self._plan_for(now + takes, lambda _: said.Completion(activity.action, activity.end))

    plan = without_conditions(within(act("(a)", "0.5", 3), upper="2.00025"))
    executive = PlanExecutive(plan, SemanticReasoner)
    outcome, grid = examples.watch(executive, team=Slow), executive.progress.grid
    assert grid == Fraction(1, 4000)
    assert isinstance(outcome, said.Failed) is (takes is None)
    if takes is None:
        assert outcome.time - executive.progress.times[plan.network.activities[0].source] == Fraction("2.00025") + grid


def test_how_rehearsals_end_and_that_the_team_has_a_judge_of_its_own(monkeypatch):
    """Without a disturbance a bagel is possible, and planned changes are no violations; a deadline ends what it can."""
    record = Rehearsal(kitchen(), tale(xA1="glass", xA3="bagel"), infer=False).run()
    assert record.choices["xA3"] == "bagel"
    assert not any(isinstance(each, said.Violated) for step in record.steps for each in step.decisions)
    late = Rehearsal(kitchen(), deadline=Deadline.after(0)).run()
    assert (late.ending, late.steps) == (Ending.TIMEOUT, ())
    # Who takes long leaves time to others: either may take up to 9, both together 10.
    one_after_the_other = within(sequence(act("(a)", 1, 9), act("(b)", 1, 9)), upper=10)
    whole = within(parallel(one_after_the_other, act("(c)", 2, 12)), upper=11)
    assert all(cooperates(without_conditions(whole), seed) for seed in range(5))
    asked = []

    class Listening(SemanticReasoner):
        name = "listening"

        def executable(self, event, deadline):
            asked.append(event)
            return super().executable(event, deadline)

    monkeypatch.setattr(reasoners, "make_reasoner", lambda name, *, solver, deadline: Listening)
    plain, record = (Rehearsal(kitchen(), MUG, backend=name, infer=False).run() for name in ("smt", "listening"))
    assert asked
    assert (record.schedule, record.choices) == (plain.schedule, plain.choices)


PLANS = {
    "kitchen": kitchen,
    **{f"figure {name}": lambda name=name: stories.figure(name).plan() for name in ("6b", "7b")},
    **{f"drawn {index}": lambda index=index: drawn(index) for index in SOLVABLE[:5]},
}


def contradict(situation, statements):
    """Asked of another solver, from scratch."""
    session = Session(situation.semantics.terms, solver="cvc5")
    session.add(*situation.semantics.domains, *(each.formula for each in statements))
    return {Satisfiability.UNSATISFIABLE: True, Satisfiability.SATISFIABLE: False}[session.check("a test")]


def check_moment(executive):
    """All questions about one moment; how many conflicts there were."""
    plan, progress, conflicts = executive.plan, executive.progress, 0
    situation = Situation(progress)
    assignments = [Assignment(choice.name, value) for choice in plan.network.choices for value in choice.domain]
    questions = [situation.assignments(About.ASSUMPTION, [each]) for each in assignments]
    questions += [[situation.executed_now(event), *situation.unreported()] for event in progress.frontier]
    for hypotheses in questions:
        statements, continuation = situation.conflict(hypotheses), situation.continued(hypotheses)
        assert (statements is None) == (continuation is not None)
        if statements is None:
            assert faults(plan, continuation) == ()
            assert progress.times.items() <= continuation.schedule.items()
            assert progress.chosen.items() <= continuation.scenario.items()
        else:
            assert contradict(situation, statements)
            for fewer in combinations(statements, len(statements) - 1):
                assert not contradict(situation, fewer), [each.text for each in statements]
            conflicts += 1
    return conflicts


@pytest.mark.parametrize(
    ("name", "most"),
    [
        *((name, 4) for name in ("figure 6b", "figure 7b")),
        ("kitchen", 0),
        *(pytest.param(name, 12, marks=pytest.mark.slow) for name in PLANS if not name.startswith("figure")),
    ],
)
def test_conflicts_are_minimal_and_schedules_correct(name, most):
    moments, conflicts = [], []

    def look(executive, now, decisions):
        if decisions and len(moments) < most:
            moments.append(now)
            if len(moments) % 4 == 0:
                conflicts.append(check_moment(executive))

    executive = PlanExecutive(PLANS[name](), SemanticReasoner)
    examples.watch(executive, look, story=Story(human=Human.CARELESS), seed=1)
    assert sum(conflicts) + check_moment(executive)


# What is said of the story with the mug, and of a wrong choice in it, is among the recorded executions.


def test_a_broken_toaster_is_the_reason_for_cereal():
    """Continuations are correct until the toaster breaks; to give reasons changes no decision."""
    story = tale(BROKEN, xA1="glass")
    record = Rehearsal(kitchen(), story, explain=True).run()
    assert (record.ending, record.choices["xA3"]) == (Ending.SUCCEEDED, "cereal")
    without = Rehearsal(kitchen(), story, explain=False, infer=False).run()
    assert [each.decisions for each in record.steps] == [each.decisions for each in without.steps]
    violations = [(each, step) for step in record.steps for each in step.decisions if isinstance(each, said.Violated)]
    ((violation, step),) = violations
    assert (violation.atom, violation.consumers) == (TOASTER, ("(toast-bagel human)",))
    assert step.inferred == {"xA3": ("cereal",), "xR2": ("milk",), "xA4": ("cereal",)}
    assert all(faults(kitchen(), each.reasons.continuation) == () for each in record.steps)
    lines = step.reasons.inferences["xA4"].text.splitlines()
    assert lines[0] == "not bagel:"
    assert "(working toaster) from the initial state does not hold any more for (toast-bagel human)" in lines[1]
    assert "(toast-bagel human) needs (working toaster), which only the initial state establishes" in lines[2]


def failed():
    executive = fetching()
    executive.step(executive.progress.now + Fraction(1, 10), [said.Completion("(get human mug)")])
    return executive


@pytest.mark.parametrize(
    ("moment", "question", "obstacle", "text"),
    [
        (started, "e1", Obstacle.DONE, "was executed at 0.001"),
        (started, "e2", Obstacle.AWAITED, "waiting to learn xA1, which is not for us to choose"),
        (started, "e14", Obstacle.EARLY, "still to come"),
        (fetching, "e4", Obstacle.AWAITED, "waiting for (get human mug) to end, begun at 0.003"),
        (fetching, "e5", Obstacle.EXCLUDED, "start of (get human glass) is not done, as xA1 = mug"),
        (fetching, Assignment("xA1", "glass"), Obstacle.EXCLUDED, "xA1 = mug has been decided"),
        (fetching, Assignment("xA3", "bagel"), Obstacle.CONFLICT, "xA3 = bagel is impossible"),
        (fetching, Assignment("xA3", "cereal"), Obstacle.NONE, "xA3 = cereal is possible"),
        (failed, "e7", Obstacle.ENDED, "(get human mug) takes at least 0.5"),
        (failed, "e7", Obstacle.ENDED, "end of (get human mug) at 0.103"),
    ],
)
def test_why_not(moment, question, obstacle, text):
    reason = why_not(moment(), question)
    assert reason.obstacle is obstacle
    assert text in reason.text
    assert bool(reason.as_dict()["conflict"]) is (obstacle in {Obstacle.CONFLICT, Obstacle.ENDED})


def test_conflicts_tell_choices_in_the_order_of_the_plan():
    """Whether they are assumed, or made one after the other, in whatever order."""
    wrong = {"xR1": "juice", "xA1": "mug"}
    assert why_none(kitchen(), guard(wrong)).conflict.choices == "xA1 = mug, xR1 = juice"
    for made in (wrong, dict(reversed(wrong.items()))):
        assert Inquiry(said.Progress(kitchen(), chosen=made)).failed().conflict.choices == "xA1 = mug, xR1 = juice"


def test_why_and_questions_without_an_answer():
    """The latest time is held against the executive: it fails if that time is missed."""
    running = fetching()
    for assignment, other in ((Assignment("xR1", "grounds"), "juice"), (Assignment("xA3", "cereal"), "bagel")):
        chosen = why(running, assignment)
        assert isinstance(chosen, WhyChosen)
        assert set(chosen.impossible) == {other}
    assert isinstance(why(running, Assignment("xA3", "bagel")), WhyNot)
    assert why_failed(running).obstacle is Obstacle.NONE
    latest = why(running, "e3").latest
    for late, ends in ((Fraction(0), False), (Fraction(1, 1000), True)):
        executive = started(None, SemanticReasoner, MUG_CHOSEN)
        executive.step(Fraction(2, 1000))
        executive.step(latest + late)
        assert executive.ended is ends
    for question, message in (
        ("e99", "unknown event e99"),
        (Assignment("xA9", "mug"), "unknown choice"),
        (Assignment("xA1", "x"), "found xA1 = 'x', expected one of mug, glass"),
    ):
        for ask in (why, why_not):
            with pytest.raises(InputError, match=message):
                ask(started(), question)
    with pytest.raises(OutOfTimeError):
        why_not(started(), Assignment("xA3", "bagel"), deadline=Deadline.after(0))
