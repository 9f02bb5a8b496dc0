"""Requests to an executive, and what a team or a clock may do wrong: activities, choices, estimates, times."""

import json
from contextlib import contextmanager
from fractions import Fraction

import jsonschema
import pytest

from robust.errors import InputError
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.journal import Journal, read_journal
from robust.pike_bridge.online.progress import JSON, Completion, Decision, Estimate, Message, Outcome
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.service import CLOSING, Service, check_message, read_request
from robust.pike_bridge.online.world import Rehearsal
from robust.plan.model import Atom
from robust.show.schemas import schema
from robust.smt.limits import OutOfTimeError
from tests.pike_bridge.online.examples import MUG, kitchen

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


def kinds(answer):
    return [each["kind"] for each in answer]


def reasons(answer):
    return [each["reason"] for each in answer if each["kind"] == "rejected"]


# -- activities --------------------------------------------------------------------------------------------------------


def test_an_activity_that_ends_in_time(told):
    answer = told("completion", action=GET_MUG, time=1)
    assert answer[0] == {"kind": "executed", "event": "e4", "time": "1", "reported": True, "step": 6}


def test_an_activity_that_ends_too_early(told):
    answer = told("completion", action=GET_MUG, time="0.1")
    assert kinds(answer) == ["executed", "failed", "end"]
    facts = [fact["fact"] for fact in told("why")[-1]["conflict"]]
    assert facts == ["start of (get human mug) at 0.003", "end of (get human mug) at 0.1"]


def test_an_activity_that_ends_too_late(told):
    assert kinds(told("tick", time=2)) == ["wake"]
    assert kinds(told("completion", action=GET_MUG, time="2.5"))[-2:] == ["failed", "end"]


def test_an_activity_that_never_ends_fails_when_it_should_have_ended(told):
    told("completion", action="(get robot grounds)", time=1)
    answer = told("state")
    while answer[-1]["kind"] != "end":
        wake = told.service.wake
        assert wake is not None
        answer = told("tick", time=str(wake))
    assert answer[-1]["outcome"] == "failed"
    assert Fraction(answer[-1]["time"]) <= Fraction("2.004")


def test_an_activity_that_ends_twice(told):
    told("completion", action=GET_MUG, time=1)
    answer = told("completion", action=GET_MUG, time=1)
    assert reasons(answer) == ["it is not running"]
    assert answer[-1]["kind"] == "wake"


def test_an_activity_that_ends_before_it_began(told):
    assert reasons(told("completion", action="(make-coffee human)", time="0.5")) == ["it is not running"]


# -- choices -----------------------------------------------------------------------------------------------------------


def test_an_outcome_that_is_repeated_or_taken_back(told):
    assert reasons(told("outcome", choice="xA1", value="mug", time=1)) == ["known already"]
    assert reasons(told("outcome", choice="xA1", value="glass", time=1)) == ["xA1 = mug was observed before"]


def test_messages_are_named_as_people_would(told):
    said = [
        told("outcome", choice="xA1", value="glass", time=1),
        told("completion", action="(make-coffee human)", time=1),
        told("estimate", true=["(a)"], false=["(a)"], complete=True, time=1),
    ]
    assert [answer[0]["message"] for answer in said] == [
        "xA1 = glass",
        "(make-coffee human) has ended",
        "seen: (a), (not (a)), all else is false",
    ]


def test_an_outcome_that_leaves_nothing_correct(told):
    assert kinds(told("outcome", choice="xA3", value="bagel", time="0.003")) == ["chosen", "failed", "end"]
    assert [fact["fact"] for fact in told("why")[-1]["conflict"]] == ["xR1 = grounds", "xA3 = bagel"]


# -- estimates ---------------------------------------------------------------------------------------------------------


def test_an_estimate_that_contradicts_itself(told):
    answer = told("estimate", true=["(working toaster)"], false=["(WORKING toaster)"], time=1)
    assert reasons(answer) == ["(working toaster) is said to be both true and false"]


def test_estimates_that_contradict_each_other_and_atoms_that_nobody_knows():
    told = Told()
    told("tick", time=0)
    told("tick", time="0.001")
    assert kinds(told("estimate", true=["(raining)"], time="0.001")) == ["wake"]
    violated = told("estimate", false=["(working toaster)"], time="0.001")
    assert kinds(violated) == ["violated", "wake"]
    assert violated[0]["atom"] == "(working toaster)"
    assert kinds(told("estimate", true=["(working toaster)"], time="0.001")) == ["wake"]


def test_a_complete_estimate_says_what_is_false():
    told = Told()
    told("tick", time=0)
    told("tick", time="0.001")
    answer = told("estimate", complete=True, time="0.001")
    assert "violated" in kinds(answer)


# -- time --------------------------------------------------------------------------------------------------------------


def test_a_clock_that_goes_back(told):
    told("tick", time=1)
    steps = told.service.steps
    assert told("tick", time="0.5") == [
        {"kind": "error", "line": told.lines, "message": f"input:{told.lines}: found time 1/2, expected 1 or later"}
    ]
    assert told.service.steps == steps
    assert kinds(told("tick", time=1)) == ["wake"]


def test_a_clock_that_jumps_ahead(told):
    assert kinds(told("tick", time=1000)) == ["failed", "end"]
    assert "it is 1000 already" in [fact["fact"] for fact in told("why")[-1]["conflict"]]


def test_what_is_due_is_taken_at_its_time_unless_that_is_long_ago():
    late = Told(tolerance=Fraction(1, 2))
    answers = list(late.service.due(Fraction(1, 4)))
    assert [each["time"] for each in answers if each["kind"] == "executed"][:2] == ["0", "1/1000"]
    too_late = Told(tolerance=Fraction(1, 2))
    answers = list(too_late.service.due(Fraction(3)))
    assert {each["time"] for each in answers if each["kind"] == "executed"} <= {"3", "3001/1000"}
    assert answers[-1]["kind"] in {"wake", "end"}


def test_real_time_never_goes_back():
    told = Told()
    list(told.service.due(Fraction(1, 1000)))
    request = read_request(b'{"kind": "tick"}', 1, kitchen(), timed=False)
    answer = list(told.service.answer(request, Fraction(0)))
    assert answer[-1]["kind"] == "wake"
    assert told.service.time == Fraction(1, 1000)


# -- steps -------------------------------------------------------------------------------------------------------------


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


def test_a_step_is_in_the_journal_before_it_is_announced(tmp_path):
    path = tmp_path / "journal"
    with Journal(path, kitchen()) as journal:
        told = Told(journal)
        for number in range(1, 4):
            request = read_request(f'{{"kind": "tick", "time": {number}e-3}}'.encode(), number, kitchen(), timed=True)
            answers = told.service.answer(request)
            next(answers)
            assert len(read_journal(path, kitchen())) == number
            list(answers)


def test_nothing_is_written_or_announced_of_a_step_that_was_given_up(tmp_path):
    path = tmp_path / "journal"

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


def test_a_deadline_while_looking_ahead_loses_nothing(tmp_path, monkeypatch):
    """The step has been taken: it is in the journal, and was announced."""
    path = tmp_path / "journal"
    with Journal(path, kitchen()) as journal:
        told = Told(journal)

        def never(*_arguments):
            raise OutOfTimeError

        monkeypatch.setattr(told.executive.reasoner, "next_time", never)
        answers = told.service.step(Fraction(0), ())
        assert next(answers)["event"] == "e_initial"
        with pytest.raises(OutOfTimeError):
            next(answers)
    with Journal(path, kitchen()) as journal:
        assert kinds(Told(journal).greeting) == ["executed", "wake"]


def test_another_back_end_may_resume(tmp_path):
    """What is in a journal does not depend on who has decided it."""
    path = tmp_path / "journal"
    with Journal(path, kitchen()) as journal:
        first = Told(journal).until_mug()
    with Journal(path, kitchen()) as journal:
        again = Told(journal, solver="cvc5")
        assert again.service.steps == first.service.steps
        assert again("possible") == [{**first("possible")[0], "line": 1}]
        assert again.service.wake == first.service.wake


# -- messages that no plan knows ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (Outcome("xA9", "mug"), "found unknown choice 'xA9', expected one of the plan; did you mean"),
        (Outcome("xA1", "cup"), "found xA1 = 'cup', expected one of mug, glass"),
        (Outcome("xR1", "juice"), "found choice xR1, expected one that is not for the executive to make"),
        (Completion("(get human mugs)"), "found unknown activity '(get human mugs)', expected one of the plan"),
        (Completion("(get human mug)", "e1"), "found event 'e1', expected where (get human mug) ends: e4"),
    ],
)
def test_what_no_plan_knows(message, expected):
    with pytest.raises(InputError) as caught:
        check_message(kitchen(), message)
    assert str(caught.value).startswith(expected)


def test_what_the_plan_knows():
    plan = kitchen()
    check_message(plan, Outcome("xA1", "mug"))
    check_message(plan, Completion("(get human mug)", "e4"))
    check_message(plan, Estimate(true=frozenset({Atom("raining")})))
