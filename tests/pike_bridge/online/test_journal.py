"""Journals: what is read is what was written, of this plan only; executives resume exactly.

What becomes of files that are cut off, damaged, in use or on full disks is tested with :mod:`robust.records`.
"""

from dataclasses import replace
from fractions import Fraction
from functools import cache

import pytest

from robust.errors import InputError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.journal import Journal, JournalStep, plan_digest, read_journal, resume
from robust.pike_bridge.online.progress import Chosen, Estimate, Executed, Outcome
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Human, Pace, Rehearsal, Story
from tests.pike_bridge.online.examples import BROKEN, KITCHEN, MUG, SOLVABLE, drawn, kitchen, tale


@cache
def steps():
    """Of the kitchen with a mug, and a disturbance that something else makes good."""
    return steps_of(kitchen(), tale(BROKEN, xA1="mug"))


def steps_of(plan, story, seed=0):
    record = Rehearsal(plan, story, seed=seed, infer=False).run()
    return tuple(JournalStep(step.time, step.messages, step.decisions) for step in record.steps)


def written(path, plan, all_steps):
    with Journal(path, plan) as journal:
        for step in all_steps:
            journal.write(step)
    return path.read_bytes()


def executive(plan):
    return PlanExecutive(plan, SemanticReasoner)


def state(executed):
    progress = executed.progress
    return progress.now, progress.times, progress.chosen, progress.void, executed.running, executed.outcome


# -- files -------------------------------------------------------------------------------------------------------------


def test_what_is_read_is_what_was_written(tmp_path):
    path = tmp_path / "journal"
    content = written(path, kitchen(), steps())
    assert read_journal(path, kitchen()) == steps()
    with Journal(path, kitchen()) as journal:
        assert journal.steps == steps()
    assert path.read_bytes() == content


def test_a_journal_that_was_cut_off(tmp_path):
    path = tmp_path / "journal"
    content = written(path, kitchen(), steps()[:4])
    last = content[:-1].rindex(b"\n") + 1
    path.write_bytes(content[:-2])
    assert read_journal(path, kitchen()) == steps()[:3]
    with Journal(path, kitchen()) as journal:
        assert journal.steps == steps()[:3]
        assert path.read_bytes() == content[:last]
        journal.write(steps()[3])
    assert path.read_bytes() == content


def test_damage_is_named_wherever_it_is(tmp_path):
    """Any one byte that is another: nothing but an error with the line."""
    path = tmp_path / "journal"
    content = written(path, kitchen(), steps()[:6])
    for at in range(0, len(content) - 1, 13):
        damaged = bytearray(content)
        damaged[at] ^= 1
        path.write_bytes(damaged)
        with pytest.raises(InputError) as caught:
            Journal(path, kitchen())
        assert str(caught.value).startswith(f"{path}:{content.count(10, 0, at) + 1}"), (at, str(caught.value))
        assert "\n" not in str(caught.value)
        assert path.read_bytes() == damaged


def test_time_does_not_go_back(tmp_path):
    path = tmp_path / "journal"
    content = written(
        path, kitchen(), (JournalStep(Fraction(2)), JournalStep(Fraction(2)), JournalStep(Fraction(1, 3)))
    )
    with pytest.raises(InputError, match=r"journal:4:10: found time 1/3, expected 2 or later"):
        read_journal(path, kitchen())
    assert path.read_bytes() == content


@pytest.mark.parametrize("content", [b"precious", b'{"format": "tpnu/1"}\n', b'{"format": "tpnu/1"}', b"\0\n"])
def test_other_files_are_left_alone(tmp_path, content):
    path = tmp_path / "notes"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        Journal(path, kitchen())
    assert str(caught.value).startswith(f"{path}:1")
    assert path.read_bytes() == content


def test_journals_of_other_plans(tmp_path):
    path = tmp_path / "journal"
    written(path, kitchen(), steps()[:2])
    later = replace(kitchen(), epsilon=Fraction(1, 500))
    with pytest.raises(InputError, match="found a journal with ε = 1/1000, expected one with 1/500"):
        Journal(path, later)
    with pytest.raises(InputError, match="found a journal of plan 'kitchen', expected one of"):
        Journal(path, drawn(SOLVABLE[0]))
    changed = replace(kitchen(), effects=kitchen().effects[1:])
    with pytest.raises(InputError, match="another version of plan 'kitchen'"):
        Journal(path, changed)


def test_the_digest_is_of_everything_that_matters():
    plan = kitchen()
    network = plan.network
    changed = [
        replace(plan, epsilon=Fraction(1)),
        replace(plan, conditions=plan.conditions[1:]),
        replace(plan, effects=plan.effects[1:]),
        replace(plan, network=replace(network, constraints=network.constraints[1:])),
        replace(plan, network=replace(network, activities=(replace(network.activities[0], upper=None),))),
        replace(plan, network=replace(network, events=(replace(network.events[0], name="e0"), *network.events[1:]))),
        replace(plan, network=replace(network, choices=tuple(reversed(network.choices)))),
    ]
    digests = {plan_digest(each) for each in (plan, *changed)}
    assert len(digests) == 1 + len(changed)
    assert plan_digest(plan) == plan_digest(load_team_plan(KITCHEN))


# -- executives --------------------------------------------------------------------------------------------------------


def follow(executed, later):
    """What an executive decides when it is told what another one was told."""
    return [executed.step(step.time, step.messages) for step in later]


@pytest.mark.parametrize("index", SOLVABLE[:2])
@pytest.mark.parametrize("human", Human)
def test_an_executive_that_resumes_anywhere_decides_the_same(index, human):
    plan = drawn(index)
    told = steps_of(plan, Story(human=human, pace=Pace.RANDOM), seed=index)
    whole = executive(plan)
    resume(whole, told)
    for end in range(0, len(told), 7):
        resumed, undisturbed = executive(plan), executive(plan)
        resume(resumed, told[:end])
        follow(undisturbed, told[:end])
        assert state(resumed) == state(undisturbed)
        assert follow(resumed, told[end:]) == [list(step.decisions) for step in told[end:]]
        assert state(resumed) == state(whole)


def test_resuming_asks_nothing():
    class Silent(SemanticReasoner):
        def _never(self, *_arguments):
            raise AssertionError

        possible = executable = could = next_time = _never

    resumed = PlanExecutive(kitchen(), Silent)
    resume(resumed, steps())
    assert resumed.ended
    assert resumed.progress.void
    assert resumed.step(Fraction(99), [Estimate()])[0].reason == "the execution has ended"


def test_steps_that_do_not_fit():
    wrong = JournalStep(Fraction(1), (), (Executed("e99", Fraction(1)),))
    with pytest.raises(InputError, match="journal:2: found event 'e99' executed"):
        resume(executive(kitchen()), [wrong])
    twice = JournalStep(Fraction(1), (), (Executed("e1", Fraction(1)), Executed("e1", Fraction(1))))
    with pytest.raises(InputError, match="journal:2: found event 'e1' executed"):
        resume(executive(kitchen()), [twice])


def test_values_are_those_of_the_record():
    """Even where the executive would choose otherwise by now."""
    plan = kitchen()
    told = steps_of(plan, MUG)
    chosen = {each.choice: each.value for step in told for each in step.decisions if isinstance(each, Chosen)}
    resumed = PlanExecutive(plan, SemanticReasoner, ranking=lambda values: list(reversed(values)))
    resume(resumed, told)
    assert resumed.progress.chosen.items() >= chosen.items()
    assert Outcome("xA1", "mug") in [message for step in told for message in step.messages]
