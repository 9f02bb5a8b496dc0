"""What leaves the most comes first: by the oracle, on contested plans and on random ones."""

from fractions import Fraction
from functools import partial

import pytest

from robust import pike
from robust.pike import act, build, choose, make_reasoner, parallel, sequence
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.model import Assignment, guard
from robust.pike_bridge.online import executive as executives
from robust.pike_bridge.online import progress as said
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem
from robust.smt.limits import OutOfTimeError
from tests.cli.running import EXAMPLES, answer_of, command

KITCHEN, WING = (EXAMPLES / name / f"{name}.tpnu.json" for name in ("kitchen", "wing"))


def tray(robots=1):
    """Robots bring a cup, a glass or both, the cup first in the plan; then a person drinks from one of the two."""
    loads = {"cup": ["cup"], "glass": ["glass"], "both": ["cup", "glass"]}
    bring = [
        choose(f"tray{at}", {load: act(f"(bring-{load}-{at})", 1, 2, agent=f"robot{at}") for load in loads})
        for at in range(robots)
    ]
    drink = choose(
        "drink", {each: act(f"(use-{each})", 1, 2, agent="ann") for each in ("cup", "glass")}, controllable=False
    )
    actions = [
        ActionText(f"bring-{load}-{at}", end_effects=tuple(f"(has-{each})" for each in what))
        for at in range(robots)
        for load, what in loads.items()
    ]
    actions += [ActionText(f"use-{each}", at_start=(f"(has-{each})",)) for each in ("cup", "glass")]
    network = build("tray", sequence(parallel(*bring), drink))
    texts = sketched_domain("tray", ("(has-cup)", "(has-glass)"), actions), sketched_problem("tray", "tray", (), ())
    return Instance(network, *texts)


@pytest.mark.parametrize("reasoner", ["smt", "windows"])
def test_the_value_that_leaves_people_the_most_is_chosen(reasoner):
    """Eager executives take the first value, and Ann cannot have a glass then; in the order of what is left, both."""
    plan = tray().plan()
    run = partial(pike.run, reasoner=reasoner, patience=None, budget=None, outcome={"drink": "glass"})
    assert (run(plan).ending, run(plan).choices["tray0"]) == (pike.Ending.FAILED, "cup")
    flexible = run(plan, rank="flexible")
    assert (flexible.ending, flexible.choices["tray0"]) == (pike.Ending.SUCCEEDED, "both")
    # With two robots anything keeps both open for Ann, if the other brings the rest: then the team's choices count.
    two = run(tray(2).plan(), rank="flexible")
    assert two.ending is pike.Ending.SUCCEEDED


class Recorder(PlanExecutive):
    """Looks, before each step, at what is known, and notes what is executed and chosen, one after the other."""

    def step(self, now, messages=()):
        decisions = super().step(now, messages)
        self.told = [*getattr(self, "told", ()), *((now, each) for each in decisions)]
        return decisions


@pytest.mark.parametrize(
    ("plan", "contested"), [(tray().plan(), 1), (tray(2).plan(), 1), (pike.load(KITCHEN), 0), (pike.load(WING), 0)]
)
def test_choices_leave_the_most_by_the_oracle(plan, contested):
    """Of what could be chosen when it was, nothing leaves more values of people's choices, and then of the team's."""
    oracle, compared = Oracle(plan), 0
    executive = Recorder(plan, make_reasoner("smt"), patience=None, flexible=True)
    now = Fraction(0)
    for _ in range(60):
        executive.step(now)
        now = executive.wake
        if executive.ended or now is None or executive.running:
            break
    times, chosen = {}, {}
    for moment, decision in executive.told:
        if isinstance(decision, said.Executed):
            times[decision.event] = decision.time
            chosen |= dict(plan.network.guards[decision.event])
        elif isinstance(decision, said.Chosen):
            values = plan.network.domains[decision.choice]
            left = {value: _left(plan, oracle, times, {**chosen, decision.choice: value}, moment) for value in values}
            assert left[decision.value] == max(left.values()), left
            compared += len(set(left.values())) > 1
            chosen[decision.choice] = decision.value
    assert compared >= contested


def _left(plan, oracle, times, chosen, now):
    """Values of people's and of the team's open choices, counted by the oracle; what others do comes after now."""
    guards = plan.network.guards

    def possible(choice, value):
        where = guard(chosen) | guards[choice.event] | {Assignment(choice.name, value)}
        if len(dict(where)) < len(where):
            return False
        return oracle.decide(where, times, now=now).verdict is ExecutionExistence.EXISTS

    own, people = (
        sum(
            possible(choice, value)
            for choice in plan.network.choices
            if choice.controllable == controllable and choice.name not in chosen
            for value in choice.domain
        )
        for controllable in (True, False)
    )
    return people, own


def test_what_has_no_time_to_be_ranked_is_taken_as_written_and_options(tmp_path, monkeypatch):
    file = tray().write(tmp_path)
    words = ("--patience", "eager", "--budget", "none", "--rank", "flexible")
    answer = answer_of(command("pike", "run", file, *words, "--json"))
    assert answer["choices"]["tray0"] == "both"
    for words in (("--reasoner", "kirk"), ("--strategy",)):
        assert "--rank: cannot be combined with" in command("pike", "run", file, "--rank", "flexible", *words).err

    def too_slow(*_):
        raise OutOfTimeError

    monkeypatch.setattr(executives, "ranked_values", too_slow)
    hurried = pike.run(file, patience=None, budget=60, rank="flexible", outcome={"drink": "cup"})
    assert (hurried.ending, hurried.choices["tray0"]) == (pike.Ending.SUCCEEDED, "cup")
