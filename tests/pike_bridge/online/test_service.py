"""Journals, requests to an executive, and what a team or a clock may do wrong: reports that are late, early, repeated
or nonsense, a clock that goes back, and services that die and resume.

What becomes of files that are cut off, damaged, in use or on full disks is tested with :mod:`robust.records`.
"""

import json
from collections import Counter
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from functools import cache
from random import Random
from unittest.mock import Mock

import jsonschema
import pytest

from robust.errors import InputError
from robust.pike import FieldExecutive, OutOfTimeError, PlanExecutive, make_reasoner, reasoner_names
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.model import Activity, Event
from robust.pike_bridge.online import semantic, service, world
from robust.pike_bridge.online.progress import JSON, Chosen, Decision, Estimate, Executed, Message
from tests.pike_bridge import stories
from tests.pike_bridge.online import examples
from tests.pike_bridge.online.examples import MUG, SOLVABLE, contested, drawn, kitchen
from tests.pike_bridge.online.field_worlds import decided_in_time
from tests.sampling import often
from tests.schemas import schema


@cache
def steps():
    """Of the kitchen with a mug, and a disturbance that something else makes good."""
    return steps_of(kitchen(), examples.tale(examples.BROKEN, xA1="mug"))


def steps_of(plan, story, seed=0):
    rehearsed = world.Rehearsal(plan, story, seed=seed, infer=False).run().steps
    return tuple(service.JournalStep(step.time, step.messages, step.decisions) for step in rehearsed)


def written(path, all_steps):
    with service.Journal(path, kitchen()) as journal:
        for step in all_steps:
            journal.write(step)
    return path.read_bytes()


def new_executive(plan=None, reasoner=semantic.SemanticReasoner, **options):
    return PlanExecutive(plan or kitchen(), reasoner, **options)


def state(executive):
    progress = executive.progress
    return progress.now, progress.times, progress.chosen, progress.void, executive.running, executive.outcome


@pytest.fixture
def path(tmp_path):
    return tmp_path / "journal"


def test_what_is_read_is_what_was_written_and_time_does_not_go_back(path):
    content = written(path, steps())
    assert service.read_journal(path, kitchen()) == steps()
    with service.Journal(path, kitchen()) as journal:
        assert journal.steps == steps()
    assert path.read_bytes() == content
    path.write_bytes(content[:-2])
    assert service.read_journal(path, kitchen()) == steps()[:-1]
    path.write_bytes(content.replace(b'"mug"', b'"cup"', 1))
    with pytest.raises(InputError, match=r"journal:\d+"):
        service.Journal(path, kitchen())
    path.unlink()
    with pytest.raises(InputError, match="journal: cannot read the journal: no such file or directory"):
        service.read_journal(path, kitchen())
    content = written(path, [service.JournalStep(time) for time in (Fraction(2), Fraction(2), Fraction(1, 3))])
    with pytest.raises(InputError, match=r"journal:4:10: found time 1/3, expected 2 or later"):
        service.read_journal(path, kitchen())
    assert path.read_bytes() == content


def test_journals_of_other_plans_and_what_their_digest_is_of(path):
    plan, network = kitchen(), kitchen().network
    written(path, steps()[:2])
    for other, message in (
        (replace(plan, epsilon=Fraction(1, 500)), "found a journal with ε = 1/1000, expected one with 1/500"),
        (drawn(SOLVABLE[0]), "found a journal of plan 'kitchen', expected one of"),
        (replace(plan, effects=plan.effects[1:]), "another version of plan 'kitchen'"),
    ):
        with pytest.raises(InputError, match=message):
            service.Journal(path, other)
    networks = [
        {"constraints": network.constraints[1:]},
        {"activities": (replace(network.activities[0], upper=None),)},
        {"events": (replace(network.events[0], name="e0"), *network.events[1:])},
        {"choices": tuple(reversed(network.choices))},
    ]
    changes = [{}, {"epsilon": Fraction(1)}, {"conditions": plan.conditions[1:]}, {"effects": plan.effects[1:]}]
    changes += [{"network": replace(network, **change)} for change in networks]
    assert len({service.plan_digest(replace(plan, **change)) for change in changes}) == len(changes)
    assert service.plan_digest(plan) == service.plan_digest(load_team_plan(examples.KITCHEN))


@pytest.mark.parametrize(("index", "human"), list(zip(SOLVABLE, world.Human, strict=False)))
def test_an_executive_that_resumes_anywhere_decides_the_same(index, human):
    plan = drawn(index)
    told = steps_of(plan, world.Story(human=human, pace=world.Pace.RANDOM), seed=index)
    whole = new_executive(plan)
    service.resume(whole, told)
    for end in range(0, len(told), 20):
        resumed, undisturbed = new_executive(plan), new_executive(plan)
        service.resume(resumed, told[:end])
        for step in told[:end]:
            undisturbed.step(step.time, step.messages)
        assert state(resumed) == state(undisturbed)
        assert all(tuple(resumed.step(step.time, step.messages)) == step.decisions for step in told[end:])
        assert state(resumed) == state(whole)


def test_resuming_asks_and_chooses_nothing_and_steps_fit():
    made = Mock(side_effect=semantic.SemanticReasoner)
    in_field = FieldExecutive(kitchen(), made)
    service.resume(in_field, steps())
    assert in_field.ended
    made.assert_called_once()  # before
    resumed = new_executive(None, made, ranking=lambda values: list(reversed(values)))
    service.resume(resumed, steps())
    made.assert_called_once()
    choices = [(each.choice, each.value) for step in steps() for each in step.decisions if isinstance(each, Chosen)]
    assert resumed.progress.chosen == dict(choices)
    assert resumed.ended
    assert resumed.progress.void
    assert resumed.step(Fraction(99), [Estimate()])[0].reason == "the execution has ended"
    for events in (["e99"], ["e1", "e1"]):
        wrong = service.JournalStep(Fraction(1), (), tuple(Executed(event, Fraction(1)) for event in events))
        with pytest.raises(InputError, match=f"journal:2: found event '{events[0]}' executed"):
            service.resume(new_executive(), [wrong])


OUTPUT = jsonschema.Draft202012Validator(schema("robust/pike-stdio/1"))
GET_MUG, MAKE, TOASTER = "(get human mug)", "(make-coffee human)", "(working toaster)"


class Told:
    """A service that is told lines, in the time that these give."""

    def __init__(self, journal=None, executive=None, **options):
        self.executive = new_executive() if executive is None else executive
        self.service = service.Service(self.executive, journal, **options)
        self.greeting = self.checked(self.service.greet())
        self.lines = 0

    def __call__(self, kind, **fields):
        self.lines += 1
        text = json.dumps({"kind": kind, **fields}).encode()
        return self.checked(self.service.answer(service.read_request(text, self.lines, kitchen(), timed=True)))

    @staticmethod
    def checked(answers):
        answers = list(answers)
        for answer in answers:
            OUTPUT.validate(answer)
        assert [each["kind"] in service.CLOSING for each in answers] == [False] * (len(answers) - 1) + [True]
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


def said(answer):
    """The kinds of an answer, where a rejection is its reason."""
    return [each["reason"] if each["kind"] == "rejected" else each["kind"] for each in answer]


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
def test_what_a_team_or_a_clock_says(news, expected, conflict):
    told, (kind, fields) = Told().until_mug(), news
    assert said(told(kind, **fields)) == expected
    why = told("why")[-1]
    assert why["possible"] is (conflict is None)
    assert {fact["fact"] for fact in why["conflict"] or ()} >= set(conflict or ())


def test_estimates_may_contradict_messages_are_named_as_people_would_and_a_clock_may_go_back():
    for seen, after in ({"false": [TOASTER]}, ["wake"]), ({"complete": True}, ["the execution has ended", "end"]):
        told = Told()
        told("tick", time=0)
        told("tick", time="0.001")
        violated = [each["atom"] for each in told("estimate", **seen, time="0.001") if each["kind"] == "violated"]
        assert TOASTER in violated
        assert said(told("estimate", true=[TOASTER], time="0.001")) == after
    told = Told().until_mug()
    rejected = [
        told("outcome", choice="xA1", value="glass", time=1),
        told("completion", action=MAKE, time=1),
        told("estimate", true=["(a)"], false=["(a)"], complete=True, time=1),
    ]
    messages = ["xA1 = glass", "(make-coffee human) has ended", "seen: (a), (not (a)), all else is false"]
    assert [answer[0]["message"] for answer in rejected] == messages
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


def test_lines_do_what_a_simulation_does_and_real_time_never_goes_back():
    """Each step of a rehearsal as a line: the decisions are those of the rehearsal."""
    told = Told()
    for step in steps_of(kitchen(), MUG, seed=3):
        messages = [JSON.write(Message, message) for message in step.messages]
        answer = told("together", messages=messages, time=str(step.time))
        expected = [JSON.write(Decision, decision) for decision in step.decisions]
        assert [{key: each[key] for key in each if key != "step"} for each in answer[:-1]] == expected
    assert answer[-1]["outcome"] == "succeeded"
    told = Told()
    list(told.service.due(Fraction(1, 1000)))
    request = service.read_request(b'{"kind": "tick"}', 1, kitchen(), timed=False)
    answer = list(told.service.answer(request, Fraction(0)))
    assert (answer[-1]["kind"], told.service.time) == ("wake", Fraction(1, 1000))


def test_a_step_is_in_the_journal_before_it_is_announced_unless_it_was_given_up(path):
    @contextmanager
    def interrupted():
        yield
        raise KeyboardInterrupt

    with service.Journal(path, kitchen()) as journal:
        told = Told(journal)
        usual, told.service.thinking = told.service.thinking, interrupted
        with pytest.raises(KeyboardInterrupt):
            told("tick", time=0)
        assert told.service.end("interrupted") == {"kind": "end", "outcome": "interrupted", "time": "0", "step": 0}
        assert service.read_journal(path, kitchen()) == ()
        told.service.thinking = usual
        for number in range(1, 4):
            answers = told.service.step(Fraction(number, 1000), ())
            next(answers)
            assert len(service.read_journal(path, kitchen())) == number
            list(answers)


def test_journals_lose_nothing_to_deadlines_or_other_back_ends(path):
    """The step has been taken: it is in the journal, and was announced."""
    with service.Journal(path, kitchen()) as journal:
        told = Told(journal)
        told.executive.reasoner.next_time = Mock(side_effect=OutOfTimeError)
        answers = told.service.step(Fraction(0), ())
        assert next(answers)["event"] == "e_initial"
        with pytest.raises(OutOfTimeError):
            next(answers)
    with service.Journal(path, kitchen()) as journal:
        assert said(Told(journal).greeting) == ["executed", "wake"]
    path.unlink()
    with service.Journal(path, kitchen()) as journal:
        first = Told(journal).until_mug()
    with service.Journal(path, kitchen()) as journal:
        again = Told(journal, solver="cvc5")
        assert again.service.steps == first.service.steps
        assert again("possible") == [{**first("possible")[0], "line": 1}]
        assert again.service.wake == first.service.wake


@pytest.mark.parametrize("make", [PlanExecutive, FieldExecutive])
def test_what_a_budget_left_undecided_is_decided_after_a_kill(path, make):
    for steps in range(1, 4):
        with service.Journal(path, kitchen()) as journal:
            told = Told(journal, make(kitchen(), semantic.SemanticReasoner, budget=1e-9))
            assert told.greeting == [{"kind": "wake", "time": "0", "step": steps - 1}]
            assert told("tick", time=0) == [{"kind": "wake", "time": "0", "step": steps}]
    with service.Journal(path, kitchen()) as journal:
        assert said(Told(journal, make(kitchen(), semantic.SemanticReasoner))("tick", time=0)) == ["executed", "wake"]
    assert [step.undecided for step in service.read_journal(path, kitchen())] == [True, True, True, False]


NOISE = (
    b"", b"{", b"\xff\xfe", b"[]", b"nothing", b'{"kind": "outcome"}',
    b'{"kind": "outcome", "choice": "nobody", "value": "1", "time": "1"}',
    b'{"kind": "completion", "action": "(nothing)", "time": "1"}',
    b'{"kind": "tick", "time": "soon"}', b'{"kind": "tick", "time": -1}', b'{"kind": "tick", "time": "1/0"}',
    b'{"kind": "estimate", "true": "(p)", "time": 1}', b'{"kind": "messages", "messages": [1], "time": 1}',
)  # fmt: skip
ASKED = ("possible", "state", "why")


class Misbehaved:
    """One execution of a service that is told what a number decides."""

    most = 60
    """Requests; then everybody has done what they do."""

    def __init__(self, plan, number, path, reasoner, *, unit=Fraction(1, 4)):
        self.plan, self.path, self.unit = plan, path, unit
        self.random = Random(number)  # noqa: S311 - reproducible
        self.reasoner, self.patience = reasoner, self.random.choice((Fraction(0), Fraction(0), Fraction(1)))
        self.said, self.line, self.met = [], 0, Counter()
        self.told = list(self.begin().greet())

    def begin(self):
        executive = PlanExecutive(self.plan, self.reasoner, patience=self.patience)
        self.service = service.Service(executive, service.Journal(self.path, self.plan))
        return self.service

    def run(self):
        while self.line < self.most and not self.service.ended:
            if self.random.random() < 0.08:
                self.die()
            text = self.random.choice(NOISE) if self.random.random() < 0.1 else json.dumps(self.request()).encode()
            self.line += 1
            answers = list(self.service.answer(service.read_request(text, self.line, self.plan, timed=True)))
            assert answers[-1]["kind"] in service.CLOSING
            self.met.update(each["kind"] for each in answers)
            self.told += answers
            self.judge()
        self.service.journal.close()
        return self

    def judge(self):
        if self.service.steps and not self.service.executive.progress.void:  # what is broken is beyond definition
            examples.check_against_definition(self.service.executive)

    def die(self):
        """Killed: with whatever reached the disk, or a part of a line more."""
        self.met["died"] += 1
        before, wake = self.service.executive, self.service.wake
        self.service.journal.close()
        if self.random.random() < 0.5:
            with self.path.open("ab") as file:
                file.write(b'{"time": "1", "mess'[: self.random.randint(1, 19)])
        repeated = [each for each in self.begin().greet() if each.get("repeated")]
        decided = [each for each in self.told if each["kind"] not in {"hello", *service.CLOSING}]
        assert [{**each, "repeated": True} for each in decided] == repeated
        again = self.service.executive
        assert (again.progress.times, again.progress.chosen) == (before.progress.times, before.progress.chosen)
        assert (again.running, again.outcome) == (before.running, before.outcome)
        # What was withheld is thought over again, so that it looks again no later than it would have, unless that was
        # early because the budget did not suffice for more.
        early, wakes = before.thrift.early, self.service.wake
        assert wake is None or early or (wakes is not None and wakes <= wake)

    def request(self):
        """Mostly what is due; or late, early, once more, the contrary, out of the blue, or in the past."""
        random, now, wake = self.random, self.service.time, self.service.wake
        if self.said and random.random() < 0.1:
            return random.choice(self.said)  # once more, mostly in the past by now
        times = [now, now + self.unit * random.randint(1, 12), now - self.unit]
        times += [wake] * 3 if wake is not None else []
        time = {"time": str(max(random.choice(times), Fraction(0)))}
        request = random.choice(list(self.news()) or [{"kind": "tick"}])
        request = request if request["kind"] in ASKED else {**request, **time}
        self.said.append(request)
        return request

    def news(self):
        network, random = self.plan.network, self.random
        yield {"kind": "tick"}
        for choice in network.choices:
            if not choice.controllable:
                yield {"kind": "outcome", "choice": choice.name, "value": random.choice(choice.domain)}
        for place, each in enumerate(network.activities):
            if place in self.service.executive.running or random.random() < 0.05:
                yield {"kind": "completion", "action": each.action, "event": each.target}
        if self.plan.effects and random.random() < 0.02:
            atom = str(random.choice(self.plan.effects).literal.atom)
            yield {"kind": "estimate", random.choice(("true", "false")): [atom]}


class Reported(Misbehaved):
    """An executive for the field that is told anything: what may be, with any times and goals, and what may not."""

    most = 25

    def __init__(self, plan, number, *arguments):
        self.early, self.budget = ("accept", "wait")[number % 2], (None, None, 0.001)[number % 3]
        super().__init__(plan, number, *arguments)

    def begin(self):
        options = {"early": self.early, "patience": self.patience, "budget": self.budget}
        executive = FieldExecutive(self.plan, self.reasoner, **options)
        self.service = service.Service(executive, service.Journal(self.path, self.plan))
        return self.service

    def judge(self):
        now, wake = self.service.time, self.service.wake
        assert wake is None or wake >= now
        assert all(0 <= time <= now for time in self.service.executive.progress.times.values())

    def news(self):
        random = self.random
        reports = [self.report() for _ in range(3)]
        told = [each for each in self.said if each["kind"] not in {"tick", "together", "retract", *ASKED}]
        if told and random.random() < 0.3:
            wrong = {name: value for name, value in random.choice(told).items() if name != "time"}
            reports.append({"kind": "retract", "message": wrong})
        if random.random() < 0.2:
            reports.append({"kind": "together", "messages": [self.report(), *random.sample(reports, 2)]})
        return [*reports, {"kind": "tick"}, {"kind": random.choice(ASKED)}]

    def report(self):
        """One report of any kind."""
        random, network, now = self.random, self.plan.network, self.service.time
        when = {"at": str(now - random.choice((-1, 0, 0, 1, 3)) * self.unit)} if random.random() < 0.4 else {}
        people = [each for each in network.choices if not each.controllable] or network.choices
        values = {each.name: random.choice(each.domain) for each in random.sample(people, 1)}
        kind = random.choice(
            ("outcome", "started", "completion", "completion", "failed", "aborted", "cancelled", "estimate")
        )
        if kind == "outcome":
            [(choice, value)] = values.items()
            return {"kind": kind, "choice": choice, "value": value, **when}
        if kind == "estimate":
            atoms = sorted({str(effect.literal.atom) for effect in self.plan.effects} | {"(r)"})
            seen = {random.choice(("true", "false")): [random.choice(atoms)]}
            return {"kind": kind, **seen, "complete": random.random() < 0.2, **when}
        place = random.randrange(len(network.activities))
        named = random.choice(({}, {}, {"goal": f"goal-{place + 1}"}, {"event": network.activities[place].target}))
        shown = {"outcomes": values} if kind == "completion" and random.random() < 0.2 else {}
        return {"kind": kind, "action": network.activities[place].action, **named, **shown, **when}


def misbehaved(plan, number, directory, **options):
    """What happened to a service with one of the reasoners, by turns."""
    names = ("smt", "smt", *reasoner_names())
    path = directory / f"{number}-{plan.name}-{plan.epsilon.denominator}"
    ended = Misbehaved(plan, number, path, make_reasoner(names[number % len(names)]), **options).run()
    ended.met[type(ended.service.executive.outcome).__name__] += 1
    return ended.met


def close(number):
    """A small plan whose ε is larger than what lies between many reports, of which there are more."""
    plan, random = contested(number), Random(number)  # noqa: S311 - reproducible
    network = plan.network
    reported = [each.name for each in network.events if not each.guard and random.random() < 0.6]
    more = (Activity(f"(tell {name})", "begin", name, Fraction(0), None) for name in reported)
    events, activities = (Event("begin"), *network.events), (*network.activities, *more)
    return replace(plan, network=replace(network, events=events, activities=activities), epsilon=Fraction(1, 2))


def total(plans, directory, **options):
    """What happened in executions of plans by numbers, those that admit a correct one."""
    executions = (misbehaved(plan, number, directory, **options) for number, plan in plans if examples.possible(plan))
    return sum(executions, Counter())


def test_nothing_wrong_is_done_whatever_is_reported(tmp_path):
    met = total(((number, contested(number)) for number in range(often(18, 2000))), tmp_path)
    assert min(met[each] for each in ("error", "rejected", "executed", "died", "Failed", "Succeeded")) > 1
    for name in ("kitchen", "wing"):
        told = getattr(stories, name)().plan()
        assert total(((number, told) for number in range(often(2, 30))), tmp_path)["executed"] > 3
    total(((number, drawn(index)) for index in SOLVABLE[: often(0, 20)] for number in range(5)), tmp_path)


@pytest.mark.parametrize("part", [0, *(pytest.param(part, marks=pytest.mark.slow) for part in range(1, 10))])
def test_nothing_told_in_the_field_is_too_much(part, tmp_path):
    """10,000 streams of all kinds of messages: each is answered, and nothing is lost to a kill."""
    met = Counter()
    for number in range(1000 * part, 1000 * part + often(15, 1000)):
        plan = decided_in_time(Random(number), effects=True)  # noqa: S311 - reproducible
        met += Reported(plan, number, tmp_path / str(number), semantic.SemanticReasoner).run().met
    assert min(met[each] for each in ("error", "rejected", "executed", "dispatched", "deviated", "died")) > 0


def test_reports_that_are_close_are_ordered_by_arrival_for_all(tmp_path):
    """Less than ε apart, and off the grid as well; windows answer as the semantic reasoner does.

    In the 338th, an executive resumes that could execute now what was withheld before.
    """
    met, backends = 0, [make_reasoner(name) for name in reasoner_names() if name != "smt"]
    for number in sorted({338, *range(30, often(42, 460))}):
        if examples.possible(plan := close(number)):
            make = backends[number % len(backends)]

            def reasoner(progress, make=make):
                return examples.Compared(make(progress), semantic.SemanticReasoner(progress))

            ended = Misbehaved(plan, number, tmp_path / str(number), reasoner, unit=Fraction(1, 7)).run()
            progress = ended.service.executive.progress
            met += progress.close(progress.times)
    assert met > 0
