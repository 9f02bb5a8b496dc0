"""Patient executives whose team reports late, early, twice, and nonsense, whose clock goes back, who die and resume.

After each step a correct execution must be left by the definition, unless the executive has said that none is.
"""

import json
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from robust.pike_bridge.model import Activity, Event
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Failed, Succeeded
from robust.pike_bridge.online.reasoners import make_reasoner, reasoner_names
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.service import CLOSING, Journal, Service, read_request
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from tests.pike_bridge import stories
from tests.pike_bridge.online.examples import SOLVABLE, Compared, drawn, is_correct, is_left
from tests.pike_bridge.online.test_patience import contested

NOISE = (
    b"",
    b"{",
    b"\xff\xfe",
    b"[]",
    b"nothing",
    b'{"kind": "outcome"}',
    b'{"kind": "outcome", "choice": "nobody", "value": "1", "time": "1"}',
    b'{"kind": "completion", "action": "(nothing)", "time": "1"}',
    b'{"kind": "tick", "time": "soon"}',
    b'{"kind": "tick", "time": -1}',
    b'{"kind": "tick", "time": "1/0"}',
    b'{"kind": "estimate", "true": "(p)", "time": 1}',
    b'{"kind": "messages", "messages": [1], "time": 1}',
)
MOST = 60
"""Requests; then everybody has done what they do."""


class Misbehaved:
    """One execution of a service that is told what a number decides."""

    def __init__(self, plan, number, path, reasoner, *, unit=Fraction(1, 4)):
        self.plan, self.path, self.unit = plan, path, unit
        self.random = Random(number)  # noqa: S311 - reproducible
        self.reasoner, self.patience = reasoner, self.random.choice((Fraction(0), Fraction(0), Fraction(1)))
        self.said, self.line, self.met = [], 0, Counter()
        self.service = self.begun()
        self.told = list(self.service.greet())

    def begun(self):
        executive = PlanExecutive(self.plan, self.reasoner, patience=self.patience)
        return Service(executive, Journal(self.path, self.plan))

    def run(self):
        while self.line < MOST and not self.service.ended:
            if self.random.random() < 0.08:
                self.die()
            text = self.random.choice(NOISE) if self.random.random() < 0.1 else json.dumps(self.request()).encode()
            self.send(text)
        self.service.journal.close()
        return self

    def send(self, text):
        self.line += 1
        answers = list(self.service.answer(read_request(text, self.line, self.plan, timed=True)))
        assert answers[-1]["kind"] in CLOSING
        self.met.update(each["kind"] for each in answers)
        self.told += answers
        self.check()

    def check(self):
        executive = self.service.executive
        progress = executive.progress
        if progress.void:
            return  # what is broken is beyond the definition
        if isinstance(executive.outcome, Succeeded):
            assert is_correct(self.plan, progress), (self.plan.name, self.said)
        elif self.service.steps:
            assert is_left(self.plan, progress) != isinstance(executive.outcome, Failed), (self.plan.name, self.said)

    def die(self):
        """Killed: with whatever reached the disk, or a part of a line more."""
        self.met["died"] += 1
        executive, wake = self.service.executive, self.service.wake
        self.service.journal.close()
        if self.random.random() < 0.5:
            with self.path.open("ab") as file:
                file.write(b'{"time": "1", "mess'[: self.random.randint(1, 19)])
        self.service = self.begun()
        repeated = [each for each in self.service.greet() if each.get("repeated")]
        decided = [each for each in self.told if each["kind"] not in {"hello", *CLOSING}]
        assert [{**each, "repeated": True} for each in decided] == repeated
        again = self.service.executive
        assert again.progress.times == executive.progress.times
        assert again.progress.chosen == executive.progress.chosen
        assert (again.running, again.outcome) == (executive.running, executive.outcome)
        # What was withheld is thought over again, so that it looks again no later than it would have.
        assert wake is None or (self.service.wake is not None and self.service.wake <= wake)

    def request(self):
        """Mostly what is due; or late, early, once more, the contrary, out of the blue, or in the past."""
        random, now = self.random, self.service.time
        if self.said and random.random() < 0.1:
            return random.choice(self.said)  # once more, mostly in the past by now
        wake = self.service.wake
        times = [now, now + self.unit * random.randint(1, 12), now - self.unit]
        times += [wake] * 3 if wake is not None else []
        time = {"time": str(max(random.choice(times), Fraction(0)))}
        found = {**random.choice(list(self.news()) or [{"kind": "tick"}]), **time}
        self.said.append(found)
        return found

    def news(self):
        network, executive = self.plan.network, self.service.executive
        yield {"kind": "tick"}
        for choice in network.choices:
            if not choice.controllable:
                yield {"kind": "outcome", "choice": choice.name, "value": self.random.choice(choice.domain)}
        for place, each in enumerate(network.activities):
            if place in executive.running or self.random.random() < 0.05:
                yield {"kind": "completion", "action": each.action, "event": each.target}
        if self.plan.effects and self.random.random() < 0.02:
            atom = str(self.random.choice(self.plan.effects).literal.atom)
            yield {"kind": "estimate", self.random.choice(("true", "false")): [atom]}


def possible(plan):
    return Oracle(plan).decide().verdict is ExecutionExistence.EXISTS


def compared(backend):
    """Windows, each of whose answers must be that of the semantic reasoner."""
    make = make_reasoner(backend)
    return lambda progress: Compared(make(progress), SemanticReasoner(progress))


def misbehaved(plan, number, directory, **options):
    """A service with one of the reasoners, by turns."""
    names = ("smt", "smt", *reasoner_names())
    path = directory / f"{number}-{plan.name}-{plan.epsilon.denominator}"
    return Misbehaved(plan, number, path, make_reasoner(names[number % len(names)]), **options).run()


def close(number):
    """A small plan whose ε is larger than what lies between many reports, of which there are more."""
    plan, random = contested(number), Random(number)  # noqa: S311 - reproducible
    network = plan.network
    told = [each.name for each in network.events if not each.guard and random.random() < 0.6]
    more = (Activity(f"(tell {name})", "begin", name, Fraction(0), None) for name in told)
    events, activities = (Event("begin"), *network.events), (*network.activities, *more)
    return replace(plan, network=replace(network, events=events, activities=activities), epsilon=Fraction(1, 2))


def tried(numbers, directory):
    """What happened in executions of small plans and of stories, and what is close to something else."""
    met = Counter()
    for number in numbers:
        if possible(plan := contested(number)):
            found = misbehaved(plan, number, directory)
            met += found.met
            met[type(found.service.executive.outcome).__name__] += 1
    return met


def test_nothing_wrong_is_done_whatever_is_reported(tmp_path):
    met = tried(range(35), tmp_path)
    assert min(met[each] for each in ("error", "rejected", "executed", "died", "Failed", "Succeeded")) > 2


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_nothing_wrong_is_done_in_stories(name, tmp_path):
    found = [misbehaved(getattr(stories, name)().plan(), number, tmp_path) for number in range(2)]
    assert sum(each.met["executed"] for each in found) > 3


def test_reports_that_are_close_are_ordered_by_arrival_for_all(tmp_path):
    """Less than ε apart, and off the grid as well."""
    met, backends = 0, [name for name in reasoner_names() if name != "smt"]
    for number in range(30, 60):
        if possible(plan := close(number)):
            path, reasoner = tmp_path / str(number), compared(backends[number % len(backends)])
            executive = Misbehaved(plan, number, path, reasoner, unit=Fraction(1, 7)).run().service.executive
            met += executive.progress.close(executive.progress.times)
    assert met > 1


@pytest.mark.slow
def test_nothing_wrong_is_done_in_many_executions(tmp_path):
    met, count = tried(range(60, 2000), tmp_path), 0
    for number in range(60, 460):
        if possible(plan := close(number)):
            misbehaved(plan, number, tmp_path, unit=Fraction(1, 7))
            count += 1
    for index in SOLVABLE:
        for number in range(5):
            misbehaved(drawn(index), 10_000 + number, tmp_path)
            count += 1
    for name in ("kitchen", "wing"):
        for number in range(30):
            misbehaved(getattr(stories, name)().plan(), 20_000 + number, tmp_path)
            count += 1
    assert met["Failed"] + met["Succeeded"] + met["NoneType"] + count >= 1000
