"""Executives for robots and people as they are: each kind of report, and random worlds, which a simulator judges."""

import json
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from robust.errors import InputError
from robust.json_text import parse_line
from robust.pike import FieldExecutive, FieldState, JournalStep, resume
from robust.pike_bridge.model import (
    Activity,
    Choice,
    Condition,
    Constraint,
    Effect,
    Event,
    Literal,
    TeamPlan,
    Tpnu,
    guard,
)
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.progress import JSON
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.plan.model import Atom
from tests.pike_bridge.online.examples import kitchen
from tests.pike_bridge.online.field_worlds import KINDS, carried_out, decided_in_time, judged
from tests.sampling import often

HAVE, DONE = Literal(Atom("have")), Literal(Atom("done"))
WITHOUT = Literal(Atom("have"), False)


def executive(plan, **options):
    return FieldExecutive(plan, SemanticReasoner, **options)


def advance(chosen, until):
    """Step whenever the executive wants to, up to a time; all that it decides."""
    decisions = []
    while not chosen.ended and chosen.wake is not None and chosen.wake <= until:
        decisions += chosen.step(chosen.wake)
    return decisions


def fetching(*, choices=(), more=(), limit=None, needed=True):
    """Someone fetches something, 2 to 4, which somebody uses afterwards, 1 to 2."""
    events = (
        Event("begin"),
        Event("fetched"),
        Event("use"),
        Event("used"),
        *(each for each in more if isinstance(each, Event)),
    )
    bounds = [Constraint("fetched", "use", Fraction(1, 10), None)]
    bounds += [Constraint("begin", "used", Fraction(0), limit)] if limit is not None else []
    bounds += [each for each in more if isinstance(each, Constraint)]
    fetch = Activity("(fetch)", "begin", "fetched", Fraction(2), Fraction(4), agent="robot")
    use = Activity("(use)", "use", "used", Fraction(1), Fraction(2), agent="human")
    conditions = (Condition(HAVE, "use", "use", guard({}), 1),) if needed else ()
    effects = [Effect(HAVE, "fetched", guard({}), 0), *(each for each in more if isinstance(each, Effect))]
    return TeamPlan(Tpnu("fetching", tuple(choices), events, tuple(bounds), (fetch, use)), conditions, tuple(effects))


FETCHED, USED = said.Completion("(fetch)"), said.Completion("(use)")


def begun_all(plan, **options):
    chosen = executive(plan, **options)
    chosen.step(Fraction(0))
    return chosen


def kinds(decisions):
    return [type(each).kind() for each in decisions]


def begun(plan, **options):
    chosen = begun_all(plan, **options)
    assert chosen.running == {0: 0}
    return chosen


def test_an_early_end_is_taken_as_it_is():
    chosen = begun(fetching())
    decisions = chosen.step(Fraction(1), [FETCHED])
    assert "deviated" in kinds(decisions)
    assert chosen.progress.times["fetched"] == 1
    advance(chosen, Fraction(2))
    assert chosen.step(Fraction(3), [USED])[-1].kind() == "succeeded"


TIGHT = (Constraint("fetched", "use", Fraction(0), Fraction(1, 2)), Constraint("begin", "use", Fraction(5, 2), None))
"""Nothing is used before 2.5; only an end at 2 or later leaves that."""


def test_an_early_end_waits_if_that_is_asked_for_or_needed():
    waiting = begun(fetching(), early="wait")
    waiting.step(Fraction(1), [FETCHED])
    assert "fetched" not in waiting.progress.times
    advance(waiting, Fraction(3))
    assert waiting.progress.times["fetched"] == 1 or waiting.progress.times["fetched"] == 2
    needed = begun(fetching(more=TIGHT))
    (deviation,) = (each for each in needed.step(Fraction(1), [FETCHED]) if isinstance(each, said.Deviated))
    assert deviation.counts == 2
    assert not needed.ended
    advance(needed, Fraction(3))
    assert needed.progress.times["fetched"] == 2
    assert needed.progress.times["use"] == Fraction(5, 2)


def test_an_end_that_waits_is_announced_though_the_activity_has_deviated_before():
    """Otherwise nobody would know when it counts, nor what resumes from a journal."""
    plan, aborted = fetching(more=TIGHT, needed=False), said.ActivityAborted("(fetch)")
    told = [(Fraction(0), ()), (Fraction(1), (aborted,)), (Fraction(1), (said.Retract(aborted), FETCHED))]
    chosen, again = executive(plan), executive(plan)
    steps = [JournalStep(now, news, tuple(chosen.step(now, news))) for now, news in told]
    assert [each.counts for each in steps[-1].decisions if isinstance(each, said.Deviated)] == [2]
    resume(again, steps)
    assert (again.state(), again.wake) == (chosen.state(), chosen.wake)


def quick_or_slow(*choices):
    """The executive's choice x has to be slow if fetching takes longer than 3; other choices at the beginning."""
    slow, quick = guard({"x": "slow"}), guard({"x": "quick"})
    return fetching(
        choices=[Choice("x", ("quick", "slow"), True, "begin"), *choices],
        more=[
            Event("quick", quick),
            Event("slow", slow),
            Constraint("begin", "quick", Fraction(0), Fraction(3), quick),
            Constraint("fetched", "quick", Fraction(1, 10), None, quick),
            Constraint("fetched", "slow", Fraction(1, 10), None, slow),
        ],
    )


def test_what_is_chosen_after_a_failure_is_announced():
    """What the failure left open is decided by what is executed, although the event of the choice is over."""
    chosen = begun(quick_or_slow())
    assert chosen.progress.chosen == {"x": "quick"}
    decisions = advance(chosen, Fraction(4))
    assert [each.released for each in decisions if isinstance(each, said.Resumed)] == [("x",)]
    decisions = [*chosen.step(Fraction(4), [FETCHED]), *advance(chosen, Fraction(5))]
    assert [each for each in decisions if isinstance(each, said.Chosen)] == [said.Chosen("x", "slow", Fraction(41, 10))]


def test_a_late_end_is_judged_anew():
    """Without a limit the rest goes on; with one it fails as soon as that is certain, and what runs is cancelled."""
    chosen = begun(fetching())
    decisions = [*advance(chosen, Fraction(5)), *chosen.step(Fraction(5))]
    assert "deviated" in kinds(decisions)
    assert not chosen.ended
    chosen.step(Fraction(6), [FETCHED])
    advance(chosen, Fraction(7))
    assert chosen.step(Fraction(15, 2), [USED])[-1].kind() == "succeeded"
    limited = begun(fetching(limit=Fraction(6)))
    decisions = advance(limited, Fraction(7))
    assert kinds(decisions)[-2:] == ["cancel", "failed"]
    assert 4 < limited.outcome.time <= 6


def test_what_a_failed_activity_was_for_is_missing():
    """If nothing needs it, the plan goes on; else it fails, until somebody sees that it is there after all."""
    for report in said.NOT_ACHIEVED:
        chosen = begun(fetching(needed=False))
        chosen.step(Fraction(1), [report("(fetch)")])
        assert not chosen.ended
        chosen = begun(fetching())
        assert kinds(chosen.step(Fraction(1), [report("(fetch)")]))[-1] == "failed"
        assert chosen.step(Fraction(2)) == []
        revived = chosen.step(Fraction(3), [said.Estimate(true=frozenset({HAVE.atom}))])
        assert "failed" not in kinds(revived)
        advance(chosen, Fraction(4))
        assert chosen.step(Fraction(5), [USED])[-1].kind() == "succeeded"


def test_a_wrong_reading_can_be_taken_back():
    chosen = begun(fetching())
    chosen.step(Fraction(3), [FETCHED])
    wrong = said.Estimate(false=frozenset({HAVE.atom}))
    decisions = chosen.step(Fraction(3) + Fraction(1, 20), [wrong])
    assert {"broken", "failed"} & set(kinds(decisions)) or "violated" in kinds(decisions)
    assert chosen.ended
    decisions = chosen.step(Fraction(4), [said.Retract(wrong)])
    assert not chosen.ended
    assert "dispatched" in kinds(decisions)
    (rejected,) = chosen.step(Fraction(4), [said.Retract(wrong)])
    assert rejected.reason == "nobody has said that"


def test_what_was_seen_before_an_act_at_the_same_moment_does_not_contradict_it():
    """Whatever is told afterwards; what is seen after it at the same moment does."""
    plan = replace(fetching(), effects=(Effect(HAVE, "begin", guard({}), None),))
    for seen_first in (True, False):
        chosen, absent = executive(plan), [said.Estimate(false=frozenset({HAVE.atom}))]
        chosen.step(Fraction(0), absent if seen_first else [])
        chosen.step(Fraction(0), [] if seen_first else absent)
        chosen.step(Fraction(1), [said.Began("(fetch)", at=Fraction(1, 2))])
        assert chosen.state().facts == {HAVE.atom: seen_first}


def chain(*more):
    """Someone uses something, 1 to 2, as soon as it is fetched, 2 to 4."""
    fetch = Activity("(fetch)", "begin", "fetched", Fraction(2), Fraction(4), agent="robot")
    use = Activity("(use)", "fetched", "used", Fraction(1), Fraction(2), agent="human")
    events = tuple(map(Event, ("begin", "fetched", "used", "end")))
    bounds = (Constraint("used", "end", Fraction(5), None), *more)
    return TeamPlan(Tpnu("chain", (), events, bounds, (fetch, use)), (), ())


def test_what_was_begun_too_early_because_of_a_wrong_report_is_cancelled():
    """And begins again when what is before it has ended; what was said of its end is of no account."""
    chosen = begun(chain())
    chosen.step(Fraction(2), [FETCHED])
    decisions = chosen.step(Fraction(5, 2), [said.Retract(FETCHED)])
    assert decisions == [said.Cancel("(use)", "human", Fraction(5, 2), "goal-2")]
    assert "dispatched" in kinds(chosen.step(Fraction(3), [FETCHED]))
    again = begun(chain())
    for time, message in ((2, FETCHED), (3, USED), (4, said.Retract(FETCHED))):
        again.step(Fraction(time), [message])
    assert (again.progress.times, again.state().ended) == ({"begin": 0}, {})
    assert "dispatched" in kinds(again.step(Fraction(4), [FETCHED]))


def test_an_early_end_that_has_counted_goes_on_counting():
    """Even if only a later one would leave something when more is known."""
    chosen = begun(chain(Constraint("fetched", "used", None, Fraction(2))))
    chosen.step(Fraction(1), [FETCHED])
    assert chosen.running == {1: 1}
    chosen.step(Fraction(5, 2), [said.Began("(use)")])
    assert chosen.progress.times["fetched"] == 1
    assert chosen.ended


def test_nobody_waits_for_an_early_end_that_counts_already():
    """Its event waits for another activity that ends there: time does not stand still until then."""
    network = chain().network
    also = Activity("(watch)", "begin", "fetched", Fraction(2), Fraction(4), agent="human")
    network = replace(network, activities=(*network.activities, also))
    chosen = begun_all(TeamPlan(network, (), ()), early="wait")
    chosen.step(Fraction(1), [FETCHED])
    assert chosen.wake == 2
    for time in (2, 3):
        chosen.step(Fraction(time))
        assert chosen.wake is None or chosen.wake > time


def test_messages_of_one_moment_must_not_contradict_each_other():
    """Neither two values of a choice nor a value and what is only begun with another one; a correction may."""
    for messages, refused in (
        ([said.Outcome("x", "a"), said.Began("(do b)")], ["(do b) has begun"]),
        ([said.Began("(do b)"), said.Outcome("x", "a")], ["x = a"]),
        ([said.Outcome("x", "a", at=Fraction(1)), said.Outcome("x", "b", at=Fraction(1))], ["x = b at 1"]),
        ([said.Outcome("x", "a"), said.Retract(said.Outcome("x", "a")), said.Outcome("x", "b")], []),
    ):
        chosen = executive(waiting_for_people())
        chosen.step(Fraction(0))
        decisions = chosen.step(Fraction(1), messages)
        assert [each.message for each in decisions if isinstance(each, said.Rejected)] == refused


def test_facts_that_come_back_support_again():
    chosen = begun(fetching())
    chosen.step(Fraction(3), [FETCHED])
    chosen.step(Fraction(3), [said.Estimate(false=frozenset({HAVE.atom}))])
    chosen.step(Fraction(7, 2), [said.Estimate(true=frozenset({HAVE.atom}))])
    advance(chosen, Fraction(5))
    assert "use" in chosen.progress.times
    assert chosen.progress.times["use"] > Fraction(7, 2)


def waiting_for_people():
    """People decide at `decide`, and do what they have chosen from `go` on; both are theirs to begin."""
    choice = Choice("x", ("a", "b"), False, "decide")
    events = [
        Event("decide"),
        *(Event(f"{name} {value}", guard({"x": value})) for name in ("go", "gone") for value in "ab"),
    ]
    bounds = [Constraint("decide", f"go {value}", Fraction(1, 2), None, guard({"x": value})) for value in "ab"]
    activities = [
        Activity(
            f"(do {value})", f"go {value}", f"gone {value}", Fraction(1), Fraction(3), "human", guard({"x": value})
        )
        for value in "ab"
    ]
    effects = [
        Effect(Literal(Atom("did", (value,))), f"gone {value}", guard({"x": value}), at)
        for at, value in enumerate("ab")
    ]
    known = [Condition(Literal(Atom("did", ("a",))), "end", "end", guard({"x": "a"}), None)]
    events.append(Event("end"))
    bounds += [Constraint(f"gone {value}", "end", Fraction(1, 100), None, guard({"x": value})) for value in "ab"]
    return TeamPlan(
        Tpnu("people", (choice,), tuple(events), tuple(bounds), tuple(activities)), tuple(known), tuple(effects)
    )


def test_people_may_begin_before_they_are_told_to():
    """What had to be before it was before; their choice is known from it."""
    chosen = executive(waiting_for_people())
    chosen.step(Fraction(0))
    decisions = chosen.step(Fraction(2), [said.Began("(do a)", at=Fraction(1))])
    assert chosen.progress.times == {"decide": Fraction(1, 2), "go a": Fraction(1)}
    assert chosen.progress.chosen == {"x": "a"}
    assert said.Chosen("x", "a", Fraction(2), observed=True) in decisions
    chosen.step(Fraction(3), [said.Completion("(do a)", at=Fraction(5, 2))])
    assert chosen.progress.times["gone a"] == Fraction(5, 2)
    advance(chosen, Fraction(4))
    assert chosen.outcome.kind() == "succeeded"


def test_choices_show_in_effects_and_completions():
    """An effect that only one value of a choice can have caused tells the value; people's word counts more."""
    chosen = executive(waiting_for_people())
    chosen.step(Fraction(0))
    chosen.step(Fraction(2), [said.Estimate(true=frozenset({Atom("did", ("a",))}))])
    assert chosen.progress.chosen == {"x": "a"}
    chosen.step(Fraction(2), [said.Outcome("x", "b")])
    assert chosen.progress.chosen == {"x": "b"}
    plan = fetching(choices=[Choice("colour", ("red", "blue"), False, "use")])
    chosen = begun(plan)
    chosen.step(Fraction(3), [said.Completion("(fetch)", goal="goal-1", outcomes={"colour": "blue"})])
    assert chosen.progress.chosen == {"colour": "blue"}


def test_an_end_counts_that_shows_a_choice_which_is_known_already():
    for known in (said.Outcome("x", "a"), said.Began("(do a)")):
        chosen = executive(waiting_for_people())
        chosen.step(Fraction(0))
        chosen.step(Fraction(1), [known])
        advance(chosen, Fraction(2))
        ended = said.Completion("(do a)", outcomes={"x": "a"})
        assert "rejected" not in kinds(chosen.step(Fraction(3), [ended]))
        assert chosen.progress.times["gone a"] == 3
        (rejected,) = chosen.step(Fraction(3), [said.Completion("(do a)", outcomes={"x": "b"})])
        assert "observed before" in rejected.reason


def test_a_choice_recognised_late_was_made_when_it_was_made():
    plan = waiting_for_people()
    limit = Constraint("e", "decide", Fraction(0), Fraction(1))
    late = replace(
        plan.network, events=(Event("e"), *plan.network.events), constraints=(limit, *plan.network.constraints)
    )
    chosen = executive(replace(plan, network=late))
    chosen.step(Fraction(0))
    assert advance(chosen, Fraction(2))[-1].kind() == "failed"
    chosen.step(Fraction(2), [said.Outcome("x", "b", at=Fraction(1, 2))])
    assert not chosen.ended
    assert chosen.progress.times["decide"] == Fraction(1, 2)


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (said.Began("(sing)"), "there is no such activity"),
        (said.Began("(fetch)", goal="goal-7"), "there is no such activity"),
        (USED, "it is not running"),
        (said.Completion("(fetch)", at=Fraction(9)), "found a time that is not yet"),
        (said.Completion("(fetch)", at=Fraction(-1)), "found a time that is before the beginning"),
        (said.Began("(use)"), "what ends at fetched is before it, and has not ended"),
        (
            said.Estimate(true=frozenset({HAVE.atom}), false=frozenset({HAVE.atom})),
            "(have) is said to be both true and false",
        ),
        (said.Outcome("nothing", "1"), "there is no choice 'nothing'"),
    ],
)
def test_what_contradicts_what_is_known_is_refused(message, reason):
    chosen = begun(fetching())
    (rejected,) = chosen.step(Fraction(1), [message])
    assert rejected == said.Rejected(str(message), reason, Fraction(1))
    assert not chosen.ended


def test_a_planner_is_asked_where_nothing_is_left():
    states = []

    def planner(state):
        states.append(state)
        return fetching() if len(states) == 1 else None

    chosen = begun(fetching(), planner=planner)
    decisions = chosen.step(Fraction(1), [said.ActivityFailed("(fetch)")])
    assert kinds(decisions)[-3:] == ["resumed", "executed", "dispatched"]
    assert states[0].ended == {"goal-1": ("failed", Fraction(1))}
    chosen.step(Fraction(4), [FETCHED])
    advance(chosen, Fraction(5))
    assert chosen.step(Fraction(6), [USED])[-1].kind() == "succeeded"


def test_another_plan_that_fails_at_once_is_judged_by_itself():
    """Nothing of the first plan, its choices above all, is left in the second."""
    other = fetching(limit=Fraction(1), choices=[Choice("how", ("slow", "fast"), True, "begin")])
    chosen = begun(fetching(choices=[Choice("speed", ("1", "2"), True, "begin")]), planner=lambda _state: other)
    decisions = chosen.step(Fraction(1), [said.ActivityFailed("(fetch)")])
    assert kinds(decisions)[-2:] == ["resumed", "failed"]
    assert chosen.plan == other
    assert chosen.state().choices == {}


def test_an_executive_goes_on_from_a_state():
    """As the one that came to it, whatever program that was part of."""
    chosen = begun(fetching())
    chosen.step(Fraction(1), [FETCHED])
    advance(chosen, Fraction(2))
    again = FieldExecutive.resumed(fetching(), SemanticReasoner, chosen.state())
    assert again.state() == chosen.state()
    assert again.step(Fraction(3), [USED])[-1].kind() == "succeeded"


def test_what_is_told_after_success_changes_nothing_when_a_journal_is_repeated():
    plan, late = fetching(), said.Retract(FETCHED)
    chosen, again = executive(plan), executive(plan)
    told = [(0, ()), (2, (FETCHED,)), (Fraction(21, 10), ()), (4, (USED,)), (6, (late,)), (7, (FETCHED,))]
    steps = [JournalStep(Fraction(at), news, tuple(chosen.step(Fraction(at), news))) for at, news in told]
    assert [each.reason for step in steps[-2:] for each in step.decisions] == ["the execution has ended"] * 2
    resume(again, steps)
    assert (again.state(), again.outcome) == (chosen.state(), chosen.outcome)


def test_a_state_says_when_a_late_robot_began():
    """Dispatched at 0, begun at 3: the end at 5 is in time, for whoever goes on as for who has begun."""
    chosen = begun(fetching())
    chosen.step(Fraction(3), [said.Began("(fetch)")])
    assert chosen.state().running == {"goal-1": 3}
    again = FieldExecutive.resumed(fetching(), SemanticReasoner, chosen.state())
    assert again.state() == chosen.state()
    for each in (chosen, again):
        assert kinds(advance(each, Fraction(5))) == []
        assert "deviated" not in kinds(each.step(Fraction(5), [FETCHED]))


def test_what_people_chose_before_a_state_was_handed_over_stays_chosen():
    """A failure opens choices of the executive anew, not those of people."""
    chosen = begun_all(quick_or_slow(Choice("theirs", ("1", "2"), False, "begin")))
    chosen.step(Fraction(0), [said.Outcome("theirs", "1")])
    advance(chosen, Fraction(1))
    again = FieldExecutive.resumed(chosen.plan, SemanticReasoner, chosen.state())
    for each in (chosen, again):
        decisions = advance(each, Fraction(4))
        assert [one.released for one in decisions if isinstance(one, said.Resumed)] == [("x",)]
        assert each.state().choices == {"theirs": "1"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"choices": {"how": "slow"}}, "state: found unknown choice 'how'"),
        ({"schedule": {"begn": Fraction(0)}}, "state: found unknown event 'begn'; did you mean 'begin'"),
        ({"schedule": {"begin": Fraction(2)}}, "state: found time 2, expected none after that of the state, 1"),
        ({"running": {"goal-9": Fraction(0)}}, "state: found unknown goal 'goal-9'"),
        ({"ended": {"goal-1": ("completed", Fraction(1))}}, "state: found unknown end 'completed'; did you mean"),
    ],
)
def test_a_state_that_is_none_of_the_plan_is_an_error(changes, message):
    state = FieldState(Fraction(1), {}, {"begin": Fraction(0)}, {"goal-1": Fraction(0)}, {}, {})
    assert FieldExecutive.resumed(fetching(), SemanticReasoner, state).running == {0: 0}
    with pytest.raises(InputError, match=message):
        FieldExecutive.resumed(fetching(), SemanticReasoner, replace(state, **changes))
    with pytest.raises(InputError, match="early: found 'late', expected accept or wait"):
        executive(fetching(), early="late")


def test_times_are_any_numbers_and_messages_are_messages():
    one, other = executive(fetching()), executive(fetching())
    assert one.step(0.5) == other.step(Fraction(1, 2))
    ended = [str(decision) for decision in one.step("1.5")]
    assert ended == [str(decision) for decision in other.step(Fraction(3, 2))]
    assert said.Completion("(fetch)", at=0.25) == said.Completion("(fetch)", at=Fraction(1, 4))
    for make in (lambda: said.Completion("(fetch)", at="soon"), lambda: said.Estimate(at=True)):
        with pytest.raises(InputError, match=r"at: found .*, expected a number"):
            make()
    for wrong, message in (
        ((None,), "now: found .None., expected a number"),
        ((2, ["done"]), "messages: found 'done', expected messages such"),
    ):
        with pytest.raises(InputError, match=message):
            one.step(*wrong)


# -- random worlds -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", [0, *(pytest.param(part, marks=pytest.mark.slow) for part in range(1, 10))])
def test_executions_in_random_worlds_are_what_brute_force_says(part):
    """1,000 executions, with all kinds of messages, late and repeated: what is left at each step."""
    counts = Counter()
    for number in range(often(15, 100)):
        judged(100 * part + number, counts)
    assert sum(counts[kind] > 0 for kind in KINDS) >= often(7, len(KINDS))


@pytest.mark.parametrize("seed", range(often(10, 300)))
def test_what_has_happened_does_not_depend_on_the_order_of_reports(seed):
    """Nor on whether they were retracted and told again, and a journal leads to the same state."""
    random = Random(seed)  # noqa: S311 - reproducible
    chosen, _ = carried_out(decided_in_time(random), random, patience=None)
    state = chosen.state()
    notes = [each for each in chosen.notes if not isinstance(each.report, said.Estimate)]
    others = [each for each in chosen.notes if isinstance(each.report, said.Estimate)]
    again = FieldExecutive.resumed(chosen.plan, SemanticReasoner, state)
    assert again.state().schedule == state.schedule
    assert again.state().choices == state.choices
    shuffled = random.sample(notes, len(notes)) + others
    chosen.notes[:] = shuffled
    chosen.judge_anew(state.time)
    assert chosen.state() == state


@pytest.mark.parametrize("seed", range(often(10, 300)))
def test_a_journal_leads_to_where_it_was_written(seed):
    """Whenever a process was killed: the same state, and the same decision next."""
    random = Random(seed)  # noqa: S311 - reproducible
    early = random.choice(("accept", "wait"))
    plan = decided_in_time(random)
    chosen, _ = carried_out(plan, random, early=early, patience=None)
    length = random.randint(0, len(chosen.steps))
    again = executive(plan, early=early, patience=None)
    lines = (json.dumps(JSON.write(JournalStep, step)) for step in chosen.steps[:length])
    resume(again, [JSON.read(JournalStep, parse_line(line, "journal")) for line in lines])
    for step in chosen.steps[length:]:
        assert again.step(step.time, step.messages) == list(step.decisions)
    assert again.state() == chosen.state()
    assert again.outcome == chosen.outcome


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        (
            JournalStep(Fraction(1), (said.Began("(fly human)"),), ()),
            "taken, expected it to be rejected: there is no such",
        ),
        (
            JournalStep(Fraction(1), (), (said.Resumed(Fraction(1), (), planned=True),)),
            "found another plan of a planner",
        ),
    ],
)
def test_steps_that_cannot_have_been_taken_say_where_they_are(step, reason):
    with pytest.raises(InputError, match=f"^journal:3: .*{reason}"):
        resume(executive(kitchen()), [JournalStep(Fraction(0), (), ()), step])


@pytest.mark.parametrize("seed", range(4))
def test_the_kitchen_survives_early_and_late_robots(seed):
    """Nothing that only takes 0.1 less or more than it may ends breakfast as long as there is time."""
    random = Random(seed)  # noqa: S311 - reproducible
    network = kitchen().network
    relaxed = tuple(
        replace(each, upper=Fraction(30)) if each.target == "e44" and each.source == "e1" else each
        for each in network.constraints
    )
    plan = replace(kitchen(), network=replace(network, constraints=relaxed))
    chosen, running, now = executive(plan), {}, Fraction(0)
    for _ in range(200):
        ended = [end for end, (time, _) in running.items() if time <= now]
        decisions = chosen.step(now, [running.pop(end)[1] for end in ended])
        if chosen.ended:
            break
        for each in decisions:
            if isinstance(each, said.Dispatched):
                lasts = random.choice((each.lower - Fraction(1, 10), each.upper + Fraction(1, 10)))
                running[each.end] = now + lasts, said.Completion(each.action, goal=each.goal)
        for choice in plan.network.choices:
            if (
                not choice.controllable
                and choice.name not in chosen.progress.chosen
                and choice.event in chosen.progress.frontier
            ):
                value = random.choice(chosen.possible_values(choice.name))
                decisions += chosen.step(now, [said.Outcome(choice.name, value)])
        moments = [time for time, _ in running.values()] + ([] if chosen.wake is None else [chosen.wake])
        now = max(now, min(moments))
    assert chosen.outcome.kind() == "succeeded"


def test_what_cannot_be_mended_fails_however_little_time_steps_have():
    chosen, decisions = executive(fetching(limit=Fraction(2)), budget=1e-5), []
    for _ in range(300):
        if not chosen.ended:
            decisions += chosen.step(chosen.wake)
    assert [type(each) for each in decisions] == [said.Failed]
