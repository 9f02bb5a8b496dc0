"""The promise of a dynamically controllable box: while everything is observed inside, the plan succeeds."""

from random import Random

import pytest

from robust.api import envelope
from robust.bench.figure4_instances import recorded_instances
from robust.execute.dispatch.dispatcher import Dispatcher
from robust.execute.dispatch.network import Guarantee
from robust.execute.dispatch.prepare import make_dispatchable
from robust.execute.drive import simulate as run_in_world
from robust.execute.worlds.luck import Luck
from robust.execute.worlds.world import Setting, SimulatedWorld
from robust.plan.load import load_plan
from robust.plan.simulate import simulate
from tests.execute.execution import PLANS, drawn, fixed, with_box


def succeeds(dispatchable, runs):
    """Executes with values from all over the box, often at its corners; the simulator judges each execution."""
    assert dispatchable.guarantee is Guarantee.DYNAMIC
    setting = Setting(dispatchable)
    for seed in range(runs):
        values = drawn(dispatchable.box, Random(seed))  # noqa: S311 - reproducible
        dispatcher = Dispatcher(dispatchable)
        run_in_world(dispatcher, SimulatedWorld(setting, Luck(fixed(values), seed)))
        assert (dispatcher.ended, dispatcher.ending, dispatcher.rejected) == (True, None, []), (seed, values)
        judged = simulate(dispatchable.plan, values, dispatcher.times, epsilon=dispatchable.epsilon)
        assert judged.valid, (seed, values, judged.violations, judged.network_violations)


@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: plan[3])
def test_inside_a_controllable_box_every_execution_succeeds(plan):
    succeeds(with_box(*plan), 25)


@pytest.mark.slow
@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: plan[3])
def test_inside_a_controllable_box_a_thousand_executions_succeed(plan):
    succeeds(with_box(*plan), 1000)


@pytest.mark.slow
@pytest.mark.parametrize("index", range(27))
def test_inside_the_box_of_a_recorded_plan_every_execution_succeeds(dataset, index, tmp_path):
    """A hundred and fifty executions of each: with those above, more than ten thousand."""
    instances = recorded_instances(dataset)
    assert len(instances) == 27
    plan = load_plan(*instances[index].write(tmp_path))
    succeeds(make_dispatchable(plan, envelope(plan).box), 150)
