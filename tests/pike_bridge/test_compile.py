"""Does a correct execution exist? The same answer by every back end, with an execution that the referee accepts."""

from __future__ import annotations

import pytest

from robust.errors import InputError
from robust.pike_bridge.compile import Checking, Compiling, PlanVerdict, Temporal, checked_assumptions
from robust.pike_bridge.generators.random_plans import Shape, random_plan
from robust.pike_bridge.generators.stories import kitchen
from robust.pike_bridge.model import guard
from robust.pike_bridge.semantics import Oracle, faults
from robust.smt.limits import Deadline, OutOfTimeError

BACKENDS = ("oracle", "pitms", "atms", "sat", "bdd")
KITCHEN = kitchen().plan()
MUG = {"xA1": "mug", "xR1": "grounds", "xA2": "coffee", "xA3": "cereal", "xR2": "milk", "xA4": "cereal"}
SMALL = Shape(top=4, inner=2, inner_share=0.4)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("temporal", list(Temporal))
def test_kitchen(backend, temporal):
    found = Checking(KITCHEN, backend, assume=guard({"xA1": "mug"}), all_scenarios=True, temporal=temporal).run()
    assert (found.verdict, found.complete) == (PlanVerdict.PROVED, True)
    assert [dict(one) for one in found.scenarios or ()] == [MUG]
    assert found.execution is not None
    assert faults(KITCHEN, found.execution) == ()
    assert max(found.execution.schedule.values()) - min(found.execution.schedule.values()) <= 8
    glass = Checking(KITCHEN, backend, assume=guard({"xA1": "glass"}), all_scenarios=True, temporal=temporal).run()
    assert {one["xA4"] for one in glass.scenarios or ()} == {"bagel", "cereal"}
    wrong = Checking(KITCHEN, backend, assume=guard({"xA1": "mug", "xR1": "juice"}), temporal=temporal).run()
    assert (wrong.verdict, wrong.execution, wrong.scenarios) == (PlanVerdict.REFUTED, None, None)


@pytest.mark.parametrize("backend", BACKENDS[1:])
def test_random_plans_as_the_oracle_has_them(backend):
    verdicts = set()
    for index in range(12):
        plan = random_plan(3, index, SMALL).plan()
        expected = {frozenset(one.scenario.items()) for one in Oracle(plan).scenarios()}
        found = Checking(plan, backend, all_scenarios=True).run()
        assert {frozenset(one.items()) for one in found.scenarios or ()} == expected
        verdicts.add(found.verdict)
    assert verdicts == {PlanVerdict.PROVED, PlanVerdict.REFUTED}


@pytest.mark.parametrize("backend", BACKENDS)
def test_out_of_time_and_interrupted(backend):
    late = Checking(KITCHEN, backend, all_scenarios=True, deadline=Deadline.after(0)).run()
    assert (late.verdict, late.complete, late.scenarios) == (PlanVerdict.UNKNOWN, False, ())

    def interrupt(stage):
        if stage == "search":
            raise KeyboardInterrupt

    stopped = Checking(KITCHEN, backend, on_stage=interrupt).run()
    assert (stopped.verdict, stopped.interrupted) == (PlanVerdict.UNKNOWN, True)


def test_compilation_keeps_what_it_has_found():
    def late(stage):
        if stage == "conflicts":
            raise OutOfTimeError

    compiling = Compiling(KITCHEN, "pitms", on_stage=late)
    with pytest.raises(OutOfTimeError):
        compiling.run()
    assert compiling.augmented is not None
    assert compiling.knowledge is None
    assert set(compiling.seconds) == {"precedence", "links"}


def test_wrong_names():
    with pytest.raises(InputError, match="there is no choice 'xA9'"):
        checked_assumptions(KITCHEN, {"xA9": "mug"})
    with pytest.raises(InputError, match="'jug' is not a value of xA1; did you mean 'mug'"):
        checked_assumptions(KITCHEN, {"xA1": "jug"})
    with pytest.raises(InputError, match="unknown knowledge base 'bddd'"):
        Checking(KITCHEN, "bddd").run()
