"""Conversion in both modes: small plans whose networks are known, drawn plans, examples, recorded plans."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import InputError
from robust.execute.convert import Conversion, ConversionEnd, Mode
from robust.execute.distances import InvalidPlanError, Original
from robust.execute.esterel import esterel_edges
from robust.execute.parametrization import option_of, write_specs
from robust.irr.check import Answer
from robust.plan.load import load_plan
from robust.plan.model import ZERO, ParametrizedPlan, TemporalConstraint, TimePoint
from robust.plan.simulate import simulate
from robust.plan.stn import write_stn
from tests.execute.plans import EPSILON, converted, text_of
from tests.pddl_text import pddl_text
from tests.plan.building import drawn
from tests.sampling import Network, bound_value, sample_schedules
from tests.strategies import plans

DOMAIN = text_of("house.pddl")


def problem(init: str = "", goal: str = "(done)") -> str:
    return f"(define (problem evening) (:domain house) (:init (= (water) 10) {init}) (:goal {goal}))"


def house(steps: str, *specs: str, init: str = "", domain: str = DOMAIN, **options) -> Conversion:
    return converted(domain, problem(init), steps, *specs, **options)


BATH = "0: (heat) [10]\n20: (bathe) [5]"
READING = "1: (switch-on)\n2: (read) [5]\n9: (switch-off)"
RESTING = "1: (switch-on)\n2: (rest) [6]\n9: (switch-off)"
FILLING = "1: (fill)\n2: (fill)\n3: (drink)"
BOTH = "0: (switch-on)\n1: (switch-off)\n2: (switch-on)\n3: (switch-off)\n4: (heat) [10]\n15: (bathe) [5]"


def lines(conversion: Conversion) -> set[str]:
    """The constraints without durations."""
    return {
        f"{bound.target} - {bound.source} in [{bound.lower}, {bound.upper}]"
        for bound in conversion.plan.constraints
        if bound.source.instance is None or bound.source.instance != bound.target.instance
    }


@pytest.mark.parametrize("case", text_of("conversions.txt").split("== ")[1:])
def test_networks(case):
    """A name, an initial state, a plan, and the constraints of its network."""
    name, init, text = case.split("\n", 2)
    steps, _, expected = text.partition("--\n")
    conversion = house(steps, init=init, mode=Mode.ESTEREL if "transformer" in name else Mode.CAUSAL)
    assert sorted(lines(conversion)) == expected.splitlines()
    assert conversion.check.answer is Answer.PROVED


def test_what_becomes_of_durations_and_orders():
    [duration] = [bound for bound in house(READING).plan.constraints if bound.source.instance == bound.target.instance]
    assert (str(duration.lower), str(duration.upper)) == ("2", "9")
    assert "n2 - n0 in [1/1000, None]" in lines(house(READING, "duration:read")), "which a parameter does not imply"
    assert house(BOTH).redundant > 0
    assert not house("0: (wait) [0.001]", init="(open)").stn.instances[0].durative
    # What is true anyway is not protected; and the transformer may miss what numbers need.
    anyway = DOMAIN.replace("(over all (or (lit) (open)))", "(over all (or (lit) (not (lit))))")
    assert lines(house(RESTING, domain=anyway)) == {"n2 - n0 in [1/1000, None]"}
    assert house(FILLING, mode=Mode.ESTEREL).check.answer is Answer.REFUTED


DRAWING = "0: (draw) [2]\n0: (heat) [10]\n11: (bathe) [5]"


def test_bounds_that_numbers_need_are_found_and_loosened_while_there_is_time():
    whole = house(DRAWING)
    [needed] = whole.tightened
    # 10 - d >= 3 as long as bathe may overlap or follow.
    assert needed.obligation == "n2 bathe: over all (>= (water) 3)"
    assert str(needed.edge) == "n0.start - n0.end >= -7"
    assert whole.check.answer is Answer.PROVED
    hasty = house(DRAWING, timeout=1e-9)
    assert (hasty.ended, hasty.check.answer) == (ConversionEnd.TIMEOUT, Answer.PROVED)
    assert sample_schedules(hasty.plan, {}, Random(1), 5) == [dict(hasty.schedule)]  # noqa: S311 - reproducible
    assert set(hasty.check.obligations) == set(whole.check.obligations)


def test_a_disjunction_whose_literals_take_turns_needs_bounds():
    # The light goes out either after unlocking or not before the rest is over; the plan does the former.
    [needed] = house("2: (rest) [6]\n3: (unlock)\n4: (switch-off)", init="(lit)").tightened
    assert needed.obligation == "n0 rest: over all (or (lit) (open))"
    assert (str(needed.edge.source), str(needed.edge.target)) == ("n1", "n2")
    assert needed.edge.weight <= Fraction(1)


def test_a_least_duration_that_others_imply_is_left_out():
    # It starts while it is open, before 4, and ends once it is open again, after 30.
    domain = DOMAIN.replace("(<= ?duration 9)", "(<= ?duration 90)")
    domain = domain.replace("(over all (lit)) :effect", "(and (at start (open)) (at end (open))) :effect")
    initial = "(open) (at 4 (not (open))) (at 30 (open))"
    conversion = house("1: (read) [40]", init=initial, domain=domain)
    bounds = {(str(bound.lower), str(bound.upper)) for bound in conversion.plan.constraints}
    assert bounds == {("None", "90"), ("None", "3999/1000"), ("30001/1000", "None")}
    assert conversion.check.answer is Answer.PROVED
    with_parameter = house("1: (read) [40]", "fluent:(water)", init=initial, domain=domain)
    assert "2" in {str(bound.lower) for bound in with_parameter.plan.constraints}


def test_what_a_plan_file_cannot_hold_is_said_beside_it_and_reads_back(tmp_path):
    conversion = house(BATH, "duration:heat", "tank=fluent:(water),lb=1/3")
    beside = [(spec.name, spec.target.value, spec.subject) for spec in conversion.beside]
    assert beside == [("tank", "fluent", "(water)"), ("dur_n0", "duration", "n0")]
    assert [parameter.name for parameter in conversion.stn.parameters] == ["dur_n0"]
    assert [bound.text for bound in conversion.plan.instances[0].durations] == ["(= ?duration dur_n0)"]
    files = [tmp_path / name for name in ("domain.pddl", "problem.pddl", "plan.stn", "parameters.toml")]
    texts = DOMAIN, problem(), write_stn(conversion.stn), write_specs(conversion.beside)
    for path, text in zip(files, texts, strict=True):
        path.write_text(text)
    for options in ({"parameter_file": files[3]}, {"parameters": [option_of(spec) for spec in conversion.beside]}):
        again, plan = load_plan(*files[:3], **options), conversion.plan
        assert (set(again.parameters), again.instances) == (set(plan.parameters), plan.instances)


OTHER = "default 7 for parameter 'dur_n0', expected the plan's own 10"
BROKEN = r"^plan.txt:2:1: invalid plan: .*'n1 bathe: at start \(warm\)' broken at time 3"


@pytest.mark.parametrize(
    ("steps", "specs", "kind", "message"),
    [
        (BATH, ["duration:heat,default=7"], InputError, OTHER),
        ("0: (heat) [10]\n3: (bathe) [5]", [], InvalidPlanError, BROKEN),
        ("0: (heat) [10]", [], InvalidPlanError, r"^plan.txt: invalid plan: found 'goal: \(done\)' broken"),
        ("0: (unlock)\n1: (wait) [1]", [], InputError, "found 'wait' used as a durative action"),
    ],
)
def test_wrong_plans_and_specifications(steps, specs, kind, message):
    with pytest.raises(kind, match=message):
        house(steps, *specs)


def sides(
    constraint: TemporalConstraint, values: dict[str, Fraction]
) -> Iterator[tuple[TimePoint, TimePoint, Fraction]]:
    """(a, b, w): t_b − t_a ≥ w."""
    if constraint.lower is not None:
        yield constraint.source, constraint.target, bound_value(constraint.lower, values)
    if constraint.upper is not None:
        yield constraint.target, constraint.source, -bound_value(constraint.upper, values)


def allows(outer: ParametrizedPlan, inner: ParametrizedPlan) -> bool:
    """Whether all schedules of `inner` at nominal values are schedules of `outer`, too."""
    network = Network(inner, inner.nominal)
    index = {point: i for i, point in enumerate(network.points)}
    bounds = [bound for constraint in outer.constraints for bound in sides(constraint, outer.nominal)]
    most = [(network.distances[index[target]][index[source]], -least) for source, target, least in bounds]
    return all(distance is not None and Fraction(distance, network.scale) <= limit for distance, limit in most)


@pytest.mark.parametrize(
    "options",
    [
        {"fluents": 0},
        {"continuous": False, "duration_in_conditions": False, "instances": 3},
        {"instances": 3, "fluents": 1, "equalities": False},
    ],
    ids=["atoms", "discrete", "continuous"],
)
def test_drawn_plans(options):
    seen: Counter[str] = Counter()

    @drawn(70)
    @given(
        plans(dyadic=True, linear=True, parameters=0, zero_durations=False, infeasible=False, tame=True, **options),
        st.randoms(use_true_random=False),
    )
    def check(plan: ParametrizedPlan, random: Random) -> None:
        for schedule in sample_schedules(plan, plan.nominal, random, 3):
            forward = all(schedule[one.start] <= schedule[one.end] for one in plan.instances)
            if not forward or not simulate(plan, plan.nominal, schedule).valid:
                continue
            texts = pddl_text(plan, plan.nominal, schedule)
            causal = converted(texts.domain, texts.problem, texts.plan)
            esterel = converted(texts.domain, texts.problem, texts.plan, mode=Mode.ESTEREL)
            assert causal.check.answer is Answer.PROVED
            seen["tightened" if causal.tightened else "orders alone"] += 1
            assert simulate(esterel.plan, {}, esterel.schedule).valid
            seen[f"esterel {esterel.check.answer.value}"] += 1
            if esterel.check.answer is Answer.PROVED and not causal.tightened:
                assert allows(causal.plan, esterel.plan)
            return

    check()
    assert seen["orders alone"] > 10
    assert seen["esterel proved"] > 5


def test_recorded_networks_are_those_of_the_transformer(dataset):
    """From the earliest schedules of the recorded plans, the transformer makes the recorded constraints again.

    Only the numbers of deadlines differ: those were taken some seconds after the problem was written.
    """
    directory = dataset / "robot-delivery"
    recorded = sorted(directory.glob("plan_*.stn"))
    assert recorded
    for path in recorded:
        problem_file = path.name.replace("plan", "problem").replace(".stn", ".pddl")
        plan = load_plan(directory / "domain.pddl", directory / problem_file, path)
        network = Network(plan, plan.nominal)
        times = dict(
            zip(network.points, (Fraction(-(row[0] or 0), network.scale) for row in network.distances), strict=True)
        )
        edges = esterel_edges(Original(replace(plan, constraints=()), times, EPSILON))
        recorded_edges = {edge for bound in plan.constraints for edge in sides(bound, plan.nominal) if edge[1] != ZERO}
        assert {tuple(edge) for edge in edges if edge.target != ZERO} == recorded_edges, path.name
        deadlines = {edge.source for edge in edges if edge.target == ZERO}
        assert deadlines == {
            bound.target for bound in plan.constraints if bound.source == ZERO and bound.upper is not None
        }
