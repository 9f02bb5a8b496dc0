"""Journals, requests to an executive, and what a team or a clock may do wrong.

What becomes of files that are cut off, damaged, in use or on full disks is tested with :mod:`robust.records`.
"""

import json
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from functools import cache
from unittest.mock import Mock

import jsonschema
import pytest

from robust.errors import InputError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import JSON, Chosen, Decision, Estimate, Executed, Message
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.service import (
    CLOSING,
    Journal,
    JournalStep,
    Service,
    plan_digest,
    read_journal,
    read_request,
    resume,
)
from robust.pike_bridge.online.world import Human, Pace, Rehearsal, Story
from robust.show.schemas import schema
from robust.smt.limits import OutOfTimeError
from tests.pike_bridge.online.examples import BROKEN, KITCHEN, MUG, SOLVABLE, drawn, kitchen, tale


@cache
def steps():
    """Of the kitchen with a mug, and a disturbance that something else makes good."""
    return steps_of(kitchen(), tale(BROKEN, xA1="mug"))


def steps_of(plan, story, seed=0):
    record = Rehearsal(plan, story, seed=seed, infer=False).run()
    return tuple(JournalStep(step.time, step.messages, step.decisions) for step in record.steps)


def written(path, all_steps):
    with Journal(path, kitchen()) as journal:
        for step in all_steps:
            journal.write(step)
    return path.read_bytes()


def state(executed):
    progress = executed.progress
    return progress.now, progress.times, progress.chosen, progress.void, executed.running, executed.outcome


@pytest.fixture
def path(tmp_path):
    return tmp_path / "journal"


def test_what_is_read_is_what_was_written(path):
    content = written(path, steps())
    assert read_journal(path, kitchen()) == steps()
    with Journal(path, kitchen()) as journal:
        assert journal.steps == steps()
    assert path.read_bytes() == content
    path.write_bytes(content[:-2])
    assert read_journal(path, kitchen()) == steps()[:-1]
    path.write_bytes(content.replace(b'"mug"', b'"cup"', 1))
    with pytest.raises(InputError, match=r"journal:\d+"):
        Journal(path, kitchen())


def test_time_does_not_go_back(path):
    content = written(path, [JournalStep(time) for time in (Fraction(2), Fraction(2), Fraction(1, 3))])
    with pytest.raises(InputError, match=r"journal:4:10: found time 1/3, expected 2 or later"):
        read_journal(path, kitchen())
    assert path.read_bytes() == content


def test_journals_of_other_plans(path):
    written(path, steps()[:2])
    for plan, message in (
        (replace(kitchen(), epsilon=Fraction(1, 500)), "found a journal with ε = 1/1000, expected one with 1/500"),
        (drawn(SOLVABLE[0]), "found a journal of plan 'kitchen', expected one of"),
        (replace(kitchen(), effects=kitchen().effects[1:]), "another version of plan 'kitchen'"),
    ):
        with pytest.raises(InputError, match=message):
            Journal(path, plan)


def test_the_digest_is_of_everything_that_matters():
    plan = kitchen()
    network = plan.network
    networks = [
        {"constraints": network.constraints[1:]},
        {"activities": (replace(network.activities[0], upper=None),)},
        {"events": (replace(network.events[0], name="e0"), *network.events[1:])},
        {"choices": tuple(reversed(network.choices))},
    ]
    plans = [{}, {"epsilon": Fraction(1)}, {"conditions": plan.conditions[1:]}, {"effects": plan.effects[1:]}]
    plans += [{"network": replace(network, **change)} for change in networks]
    assert len({plan_digest(replace(plan, **change)) for change in plans}) == len(plans)
    assert plan_digest(plan) == plan_digest(load_team_plan(KITCHEN))


@pytest.mark.parametrize("index", SOLVABLE[:2])
@pytest.mark.parametrize("human", Human)
def test_an_executive_that_resumes_anywhere_decides_the_same(index, human):
    plan = drawn(index)
    told = steps_of(plan, Story(human=human, pace=Pace.RANDOM), seed=index)
    whole = PlanExecutive(plan, SemanticReasoner)
    resume(whole, told)
    for end in range(0, len(told), 12):
        resumed, undisturbed = (PlanExecutive(plan, SemanticReasoner) for _ in range(2))
        resume(resumed, told[:end])
        for step in told[:end]:
            undisturbed.step(step.time, step.messages)
        assert state(resumed) == state(undisturbed)
        assert all(tuple(resumed.step(step.time, step.messages)) == step.decisions for step in told[end:])
        assert state(resumed) == state(whole)


def test_resuming_asks_nothing_and_chooses_nothing():
    class Silent(SemanticReasoner):
        def _never(self, *_arguments):
            raise AssertionError

        possible = executable = could = next_time = _never

    resumed = PlanExecutive(kitchen(), Silent, ranking=lambda values: list(reversed(values)))
    resume(resumed, steps())
    chosen = [(each.choice, each.value) for step in steps() for each in step.decisions if isinstance(each, Chosen)]
    assert resumed.progress.chosen == dict(chosen)
    assert resumed.ended
    assert resumed.progress.void
    assert resumed.step(Fraction(99), [Estimate()])[0].reason == "the execution has ended"


@pytest.mark.parametrize("events", [["e99"], ["e1", "e1"]], ids=["unknown", "twice"])
def test_steps_that_do_not_fit(events):
    wrong = JournalStep(Fraction(1), (), tuple(Executed(event, Fraction(1)) for event in events))
    with pytest.raises(InputError, match=f"journal:2: found event '{events[0]}' executed"):
        resume(PlanExecutive(kitchen(), SemanticReasoner), [wrong])


OUTPUT = jsonschema.Draft202012Validator(schema("robust/pike-stdio/1"))
GET_MUG = "(get human mug)"


class Told:
    """A service that is told lines, in the time that these give."""

    def __init__(self, journal=None, **options):
        self.executive = PlanExecutive(kitchen(), SemanticReasoner)
        self.service = Service(self.executive, journal, **options)
        self.greeting = self.checked(self.service.greet())
        self.lines = 0

    def __call__(self, kind, **fields):
        self.lines += 1
        text = json.dumps({"kind": kind, **fields}).encode()
        return self.checked(self.service.answer(read_request(text, self.lines, kitchen(), timed=True)))

    @staticmethod
    def checked(answers):
        answers = list(answers)
        for answer in answers:
            OUTPUT.validate(answer)
        assert [each["kind"] in CLOSING for each in answers] == [False] * (len(answers) - 1) + [True]
        return answers if answers[0]["kind"] != "hello" else answers[1:]

    def until_mug(self):
        """Up to the dispatch of the first activities; the first thing that the human does is fetch a mug."""
        self("tick", time=0)
        self("tick", time="0.001")
        self("outcome", choice="xA1", value="mug", time="0.001")
        self("tick", time="0.002")
        answer = self("tick", time="0.003")
        assert GET_MUG in [each["action"] for each in answer if each["kind"] == "dispatched"]
        return self


@pytest.fixture
def told():
    return Told().until_mug()


def said(answer):
    """The kinds of an answer, where a rejection is its reason."""
    return [each["reason"] if each["kind"] == "rejected" else each["kind"] for each in answer]


MAKE = "(make-coffee human)"
TOASTER = "(working toaster)"
NEWS = [
    (("completion", {"action": GET_MUG, "time": 1}), ["executed", "wake"], None),
    (("completion", {"action": MAKE, "time": "0.5"}), ["it is not running", "wake"], None),
    (
        ("completion", {"action": GET_MUG, "time": "0.1"}), ["executed", "failed", "end"],
        ["start of (get human mug) at 0.003", "end of (get human mug) at 0.1"],
    ),
    (("completion", {"action": GET_MUG, "time": "2.5"}), ["executed", "failed", "end"], ["it is 2.5 already"]),
    (("outcome", {"choice": "xA1", "value": "mug", "time": 1}), ["known already", "wake"], None),
    (("outcome", {"choice": "xA1", "value": "glass", "time": 1}), ["xA1 = mug was observed before", "wake"], None),
    (
        ("outcome", {"choice": "xA3", "value": "bagel", "time": "0.003"}), ["chosen", "failed", "end"],
        ["xR1 = grounds", "xA3 = bagel"],
    ),
    (
        ("estimate", {"true": [TOASTER], "false": ["(WORKING toaster)"], "time": 1}),
        [f"{TOASTER} is said to be both true and false", "wake"], None,
    ),
    (("estimate", {"true": ["(raining)"], "time": "0.003"}), ["wake"], None),
    (("tick", {"time": 2}), ["wake"], None),
    (("tick", {"time": 1000}), ["failed", "end"], ["it is 1000 already"]),
]  # fmt: skip


@pytest.mark.parametrize(("news", "expected", "conflict"), NEWS)
def test_what_a_team_or_a_clock_says(told, news, expected, conflict):
    kind, fields = news
    assert said(told(kind, **fields)) == expected
    found = told("why")[-1]
    assert found["possible"] is (conflict is None)
    assert {fact["fact"] for fact in found["conflict"] or ()} >= set(conflict or ())


def test_messages_are_named_as_people_would(told):
    rejected = [
        told("outcome", choice="xA1", value="glass", time=1),
        told("completion", action=MAKE, time=1),
        told("estimate", true=["(a)"], false=["(a)"], complete=True, time=1),
    ]
    assert [answer[0]["message"] for answer in rejected] == [
        "xA1 = glass",
        "(make-coffee human) has ended",
        "seen: (a), (not (a)), all else is false",
    ]


def test_estimates_that_contradict_the_plan_and_each_other():
    for seen, after in ({"false": [TOASTER]}, ["wake"]), ({"complete": True}, ["the execution has ended", "end"]):
        told = Told()
        told("tick", time=0)
        told("tick", time="0.001")
        violated = [each["atom"] for each in told("estimate", **seen, time="0.001") if each["kind"] == "violated"]
        assert TOASTER in violated
        assert said(told("estimate", true=[TOASTER], time="0.001")) == after


def test_a_clock_that_goes_back(told):
    told("completion", action=GET_MUG, time=1)
    steps = told.service.steps
    assert told("tick", time="0.5") == [
        {"kind": "error", "line": told.lines, "message": f"input:{told.lines}: found time 1/2, expected 1 or later"}
    ]
    assert told.service.steps == steps
    assert said(told("completion", action=GET_MUG, time=1)) == ["it is not running", "wake"]


@pytest.mark.parametrize(("now", "expected"), [("1/4", ["0", "1/1000"]), ("3", ["3"])])
def test_what_is_due_is_taken_at_its_time_unless_that_is_long_ago(now, expected):
    answers = list(Told(tolerance=Fraction(1, 2)).service.due(Fraction(now)))
    times = [each["time"] for each in answers if each["kind"] == "executed"]
    assert times[: len(expected)] == expected
    assert answers[-1]["kind"] in {"wake", "end"}
    assert now == "1/4" or set(times) <= {"3", "3001/1000"}


def test_real_time_never_goes_back():
    told = Told()
    list(told.service.due(Fraction(1, 1000)))
    request = read_request(b'{"kind": "tick"}', 1, kitchen(), timed=False)
    answer = list(told.service.answer(request, Fraction(0)))
    assert answer[-1]["kind"] == "wake"
    assert told.service.time == Fraction(1, 1000)


def test_lines_do_what_a_simulation_does():
    """Each step of a rehearsal as a line: the decisions are those of the rehearsal."""
    record = Rehearsal(kitchen(), MUG, seed=3, infer=False).run()
    told = Told()
    for step in record.steps:
        messages = [JSON.write(Message, message) for message in step.messages]
        answer = told("together", messages=messages, time=str(step.time))
        expected = [JSON.write(Decision, decision) for decision in step.decisions]
        assert [{key: each[key] for key in each if key != "step"} for each in answer[:-1]] == expected
    assert answer[-1]["outcome"] == "succeeded"


def test_a_step_is_in_the_journal_before_it_is_announced(path):
    with Journal(path, kitchen()) as journal:
        told = Told(journal)
        for number in range(1, 4):
            request = read_request(f'{{"kind": "tick", "time": {number}e-3}}'.encode(), number, kitchen(), timed=True)
            answers = told.service.answer(request)
            next(answers)
            assert len(read_journal(path, kitchen())) == number
            list(answers)


def test_nothing_is_written_or_announced_of_a_step_that_was_given_up(path):
    @contextmanager
    def interrupted():
        yield
        raise KeyboardInterrupt

    with Journal(path, kitchen()) as journal:
        told = Told(journal)
        told.service.thinking = interrupted
        with pytest.raises(KeyboardInterrupt):
            told("tick", time=0)
        assert told.service.end("interrupted") == {"kind": "end", "outcome": "interrupted", "time": "0", "step": 0}
    assert read_journal(path, kitchen()) == ()


def test_a_deadline_while_looking_ahead_loses_nothing(path):
    """The step has been taken: it is in the journal, and was announced."""
    with Journal(path, kitchen()) as journal:
        told = Told(journal)
        told.executive.reasoner.next_time = Mock(side_effect=OutOfTimeError)
        answers = told.service.step(Fraction(0), ())
        assert next(answers)["event"] == "e_initial"
        with pytest.raises(OutOfTimeError):
            next(answers)
    with Journal(path, kitchen()) as journal:
        assert said(Told(journal).greeting) == ["executed", "wake"]


def test_another_back_end_may_resume(path):
    """What is in a journal does not depend on who has decided it."""
    with Journal(path, kitchen()) as journal:
        first = Told(journal).until_mug()
    with Journal(path, kitchen()) as journal:
        again = Told(journal, solver="cvc5")
        assert again.service.steps == first.service.steps
        assert again("possible") == [{**first("possible")[0], "line": 1}]
        assert again.service.wake == first.service.wake
