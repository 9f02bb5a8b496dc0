"""The promise of a dynamically controllable box: while everything is observed inside, the plan succeeds."""

from fractions import Fraction
from random import Random

import pytest

from benchmarks.irr.figure4 import recorded_instances
from robust.api import envelope
from robust.execute.dispatch.dispatcher import Dispatcher
from robust.execute.dispatch.network import Guarantee, make_dispatchable
from robust.execute.drive import run_in_world
from robust.execute.worlds.rules import Luck
from robust.execute.worlds.world import Setting, SimulatedWorld
from robust.plan.load import load_plan
from robust.plan.simulate import simulate
from robust.qe.box import Box, Interval
from tests.execute.execution import PLANS, drawn, fixed, tasks, with_box


def succeeds(dispatchable, runs, random):
    """Executes with values from all over the box, often at its corners; the simulator judges each execution."""
    assert dispatchable.guarantee is Guarantee.DYNAMIC
    setting = Setting(dispatchable)
    for seed in range(runs):
        values = drawn(dispatchable.box, random)
        dispatcher = Dispatcher(dispatchable)
        run_in_world(dispatcher, SimulatedWorld(setting, Luck(fixed(values), seed)))
        assert (dispatcher.ended, dispatcher.ending, dispatcher.rejected) == (True, None, []), (seed, values)
        judged = simulate(dispatchable.plan, values, dispatcher.times, epsilon=dispatchable.epsilon)
        assert judged.valid, (seed, values, judged.violations, judged.network_violations)


@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: plan[3])
def test_inside_a_controllable_box_every_execution_succeeds(plan):
    succeeds(with_box(*plan), 25, Random(25))  # noqa: S311 - reproducible


@pytest.mark.slow
@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: plan[3])
def test_inside_a_controllable_box_a_thousand_executions_succeed(plan):
    succeeds(with_box(*plan), 1000, Random(1000))  # noqa: S311 - reproducible


@pytest.mark.slow
@pytest.mark.parametrize("index", range(27))
def test_inside_the_box_of_a_recorded_plan_every_execution_succeeds(dataset, index, tmp_path):
    """A hundred and fifty executions of each: with those above, more than ten thousand."""
    instances = recorded_instances(dataset)
    assert len(instances) == 27
    plan = load_plan(*instances[index].write(tmp_path))
    succeeds(make_dispatchable(plan, envelope(plan).box), 150, Random(index))  # noqa: S311 - reproducible


@pytest.mark.parametrize("seed", range(40))
def test_inside_the_box_of_a_drawn_plan_every_execution_succeeds(seed):
    """Random partial orders of tasks that nothing disturbs, with a deadline that leaves room."""
    random = Random(f"plans {seed}")  # noqa: S311 - reproducible
    count = random.randint(2, 6)
    declared, instances, constraints = [], [], []
    for number in range(count):
        nominal = random.randint(2, 9)
        declared.append(f"parameter d{number} default {nominal};")
        instances.append(f"durative-action instance w{number} : (work t{number});")
        constraints.append(f"c: w{number}.end - w{number}.start in [d{number}, d{number}];")
        for before in range(number):
            if random.random() < 0.5:
                bound = random.choice(["0.001", "1", "2.5"])
                constraints.append(f"c: w{number}.start - w{before}.end in [{bound}, inf];")
        constraints.append(f"c: w{number}.end - .zero in [0, 200];")
    objects = " ".join(f"t{number}" for number in range(count))
    atoms = " ".join(f"(ready t{number})" for number in range(count))
    goal = " ".join(f"(done t{number})" for number in range(count))
    problem = (
        f"(define (problem p) (:domain tasks) (:objects {objects} - task)"
        f" (:init {atoms} (open) (at 201 (not (open))) (= (stock) 0)) (:goal (and {goal})))"
    )
    plan = tasks("\n".join([*declared, *instances, *constraints]), problem=problem)
    box = Box({f"d{number}": Interval(Fraction(1), Fraction(200 - 3 * count, count)) for number in range(count)})
    dispatchable = make_dispatchable(plan, box)
    succeeds(dispatchable, 5, random)
