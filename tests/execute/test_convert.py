"""Conversion in both modes: small plans whose networks are known, drawn plans, examples, recorded plans."""

from collections import Counter
from fractions import Fraction
from itertools import chain
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robust.errors import InputError, SolverError
from robust.execute.convert import Conversion, Mode, convert
from robust.execute.distances import InvalidPlanError, Original
from robust.execute.esterel import esterel_edges
from robust.irr.check import Answer
from robust.plan.load import load_plan
from robust.plan.model import ZERO, ParameterReference, ParametrizedPlan
from robust.plan.pddl.reader import read_domain, read_problem
from robust.plan.simulate import simulate
from robust.plan.stn import parse_stn, write_stn
from tests.cli.running import EXAMPLES, REPOSITORY
from tests.execute.plans import allows, bare, converted, durative, lines, timed
from tests.pddl_text import pddl_text
from tests.sampling import sample_schedules
from tests.strategies import plans

TIMED = (
    durative("heat", "10", "", "(at end (warm))"),
    durative("bathe", "5", "(at start (warm)) (over all (>= (water) 3))", "(at end (done))"),
    durative("draw", ">= 1", "", "(decrease (water) (* #t 1))"),
    durative("rest", "6", "(over all (or (lit) (open)))", "(at end (done))"),
)
DOMAIN = f"""
(define (domain house)
  (:requirements :typing :durative-actions :fluents :timed-initial-literals :duration-inequalities)
  (:predicates (lit) (open) (warm) (done))
  (:functions (water))
  (:action switch-on :parameters () :precondition () :effect (lit))
  (:action press :parameters () :precondition () :effect (lit))
  (:action switch-off :parameters () :precondition () :effect (not (lit)))
  (:durative-action read :parameters () :duration (and (>= ?duration 2) (<= ?duration 9))
    :condition (over all (lit)) :effect (at end (done)))
  {" ".join(TIMED)}
  (:action unlock :parameters () :precondition () :effect (open))
  (:action fill :parameters () :precondition () :effect (increase (water) 2))
  (:action drink :parameters () :precondition (>= (water) 13) :effect (done))
  (:action wait :parameters () :precondition (open) :effect (done)))
"""


def problem(init: str = "", goal: str = "(done)") -> str:
    return f"(define (problem evening) (:domain house) (:init (= (water) 10) {init}) (:goal {goal}))"


def house(steps: str, *specs: str, init: str = "", domain: str = DOMAIN, **options) -> Conversion:
    return converted(domain, problem(init), steps, *specs, **options)


BATH = "0: (heat) [10]\n20: (bathe) [5]"
READING = "1: (switch-on)\n2: (read) [5]\n9: (switch-off)"
EITHER = DOMAIN.replace("(over all (or (lit) (open)))", "(over all (or (lit) (not (lit))))")
LITERALS = "(at 4 (open)) (at 8 (not (open))) (at 30 (not (lit))) "
WITHIN = "n0 - .zero in [4001/1000, 7999/1000]"


# -- networks ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("steps", "init", "mode", "expected"),
    [
        pytest.param(BATH, "", Mode.CAUSAL, {"n1.start - n0.end in [1/1000, None]"}, id="after the achiever"),
        pytest.param(
            READING, "", Mode.CAUSAL, {"n1.start - n0 in [0, None]", "n2 - n1.end in [0, None]"}, id="protected"
        ),
        pytest.param("1: (switch-on)\n2: (read) [5]", "(lit)", Mode.CAUSAL, set(), id="true from the beginning"),
        pytest.param(
            "1: (switch-on)\n2: (press)\n3: (read) [5]",
            "",
            Mode.CAUSAL,
            {"n2.start - n1 in [0, None]"},
            id="recent",
        ),
        pytest.param(
            "6: (wait)\n7: (read) [5]",
            LITERALS + "(at 1 (lit))",
            Mode.CAUSAL,
            {WITHIN, "n1.start - .zero in [1, None]", "n1.end - .zero in [None, 30]"},
            id="timed literals are bounds from zero",
        ),
        pytest.param(
            "1: (switch-on)\n2: (rest) [6]\n9: (switch-off)",
            "(open)",
            Mode.CAUSAL,
            {"n2 - n0 in [1/1000, None]"},
            id="one literal keeps a disjunction true",
        ),
        pytest.param(
            "1: (fill)\n2: (fill)\n3: (drink)",
            "",
            Mode.CAUSAL,
            {"n2 - n0 in [1/1000, None]", "n2 - n1 in [1/1000, None]"},
            id="numbers",
        ),
        pytest.param(
            READING,
            "",
            Mode.ESTEREL,
            {
                "n0 - .zero in [1/1000, None]",
                "n1.start - n0 in [1/1000, None]",
                "n1.end - .zero in [1/1000, None]",
                "n2 - n0 in [1/1000, None]",
                "n2 - n1.end in [1/1000, None]",
            },
            id="the transformer's supporters and contradictions",
        ),
        pytest.param(
            "6: (wait)\n7: (read) [5]",
            LITERALS + "(lit)",
            Mode.ESTEREL,
            {WITHIN, "n1.start - .zero in [1/1000, None]", "n1.end - .zero in [1/1000, 30]"},
            id="the transformer's deadlines",
        ),
    ],
)
def test_networks(steps, init, mode, expected):
    found = house(steps, init=init, mode=mode)
    assert lines(found) == expected
    assert found.check.answer is Answer.PROVED


def test_durations_keep_their_bounds():
    assert {str(one.lower) for one in house(BATH).plan.constraints} == {"1/1000", "10", "5"}
    [duration] = [one for one in house(READING).plan.constraints if one.source.instance == one.target.instance]
    assert (str(duration.lower), str(duration.upper)) == ("2", "9")


def test_an_achiever_before_the_last_threat_is_none():
    found = lines(house("1: (switch-on)\n2: (switch-off)\n3: (press)\n4: (read) [5]"))
    assert {"n3.start - n2 in [0, None]", "n1 - n0 in [1/1000, None]", "n2 - n1 in [1/1000, None]"} <= found


def test_bounds_that_numbers_need_are_found_and_loosened():
    found = house("0: (draw) [2]\n0: (heat) [10]\n11: (bathe) [5]")
    [needed] = found.tightened
    # 10 - d >= 3 as long as bathe may overlap or follow.
    assert needed.obligation == "n2 bathe: over all (>= (water) 3)"
    assert str(needed.edge) == "n0.start - n0.end >= -7"
    assert found.check.answer is Answer.PROVED


def test_a_disjunction_whose_literals_take_turns_needs_bounds():
    found = house("2: (rest) [6]\n3: (unlock)\n4: (switch-off)", init="(lit)")
    assert {one.obligation for one in found.tightened} == {"n0 rest: over all (or (lit) (open))"}
    # The light goes out either after unlocking or not before the rest is over; the plan does the former.
    [needed] = found.tightened
    assert (str(needed.edge.source), str(needed.edge.target)) == ("n1", "n2")
    assert needed.edge.weight <= Fraction(1)


def test_what_others_imply_is_left_out():
    steps = "0: (switch-on)\n1: (switch-off)\n2: (switch-on)\n3: (switch-off)\n4: (heat) [10]\n15: (bathe) [5]"
    found = house(steps)
    assert "n3 - n0 in [1/1000, None]" not in lines(found)
    assert found.redundant > 0


def test_what_durations_imply_is_left_out_unless_they_are_parameters():
    # By the duration of at least 2, the light goes out more than ε after it was switched on.
    assert "n2 - n0 in [1/1000, None]" not in lines(house(READING))
    assert "n2 - n0 in [1/1000, None]" in lines(house(READING, "duration:read"))


def test_a_least_duration_that_others_imply_is_left_out():
    # It starts while it is open, before 4, and ends once it is open again, after 30.
    domain = DOMAIN.replace("(<= ?duration 9)", "(<= ?duration 90)").replace(
        ":condition (over all (lit)) :effect", ":condition (and (at start (open)) (at end (open))) :effect"
    )
    initial = "(open) (at 4 (not (open))) (at 30 (open))"
    found = house("1: (read) [40]", init=initial, domain=domain)
    assert {(str(one.lower), str(one.upper)) for one in found.plan.constraints} == {
        ("None", "90"),
        ("None", "3999/1000"),
        ("30001/1000", "None"),
    }
    assert found.check.answer is Answer.PROVED
    with_parameter = house("1: (read) [40]", "fluent:(water)", init=initial, domain=domain)
    assert "2" in {str(one.lower) for one in with_parameter.plan.constraints}


def test_what_is_true_anyway_is_not_protected():
    assert EITHER != DOMAIN
    found = house("1: (switch-on)\n2: (rest) [6]\n9: (switch-off)", domain=EITHER)
    assert lines(found) == {"n2 - n0 in [1/1000, None]"}
    assert found.check.answer is Answer.PROVED


def test_the_transformer_never_excludes_the_plan():
    found = house("0: (switch-on)\n0: (read) [5]", mode=Mode.ESTEREL)
    assert {"n1.start - n0 in [0, None]", "n0 - .zero in [0, None]"} <= lines(found)


def test_the_transformer_may_miss_what_numbers_need():
    assert house("1: (fill)\n2: (fill)\n3: (drink)", mode=Mode.ESTEREL).check.answer is Answer.REFUTED


# -- parameters ------------------------------------------------------------------------------------------------------


def test_durations_of_all_instances_of_an_action():
    found = house("0: (read) [5]\n6: (read) [4]", "duration:read,weight=2", init="(lit)")
    assert [(one.name, one.weight, one.nominal) for one in found.plan.parameters] == [
        ("dur_n0", 2, 5),
        ("dur_n1", 2, 4),
    ]
    assert found.beside == ()
    assert "c: n0.end - n0.start in [dur_n0, dur_n0];" in write_stn(found.stn)


def test_start_times():
    found = house(BATH, "start:n1,ub=25")
    assert "c: n1.start - .zero in [start_n1, start_n1];" in write_stn(found.stn)


def test_what_a_plan_file_cannot_hold_is_said_beside_it():
    found = house(BATH, "duration:heat", "tank=fluent:(water),lb=1/3")
    assert [(one.name, one.target.value, one.subject) for one in found.beside] == [
        ("tank", "fluent", "(water)"),
        ("dur_n0", "duration", "n0"),
    ]
    assert [one.name for one in found.stn.parameters] == ["dur_n0"]
    assert [one.text for one in found.plan.instances[0].durations] == ["(= ?duration dur_n0)"]


def test_a_duration_named_again_reads_back(tmp_path):
    from robust.execute.parametrization import option_of, write_specs  # noqa: PLC0415

    found = house(BATH, "duration:heat", "tank=fluent:(water),lb=1/3")
    files = [tmp_path / name for name in ("domain.pddl", "problem.pddl", "plan.stn", "parameters.toml")]
    for path, text in zip(files, (DOMAIN, problem(), write_stn(found.stn), write_specs(found.beside)), strict=True):
        path.write_text(text)
    for options in ({"parameter_file": files[3]}, {"parameters": [option_of(one) for one in found.beside]}):
        again = load_plan(*files[:3], **options)
        assert set(again.parameters) == set(found.plan.parameters)
        assert again.instances == found.plan.instances


# -- wrong plans -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("steps", "specs", "kind", "message"),
    [
        (BATH, ["duration:heat,default=7"], InputError, "default 7 for parameter 'dur_n0', expected the plan's own 10"),
        (
            "0: (heat) [10]\n3: (bathe) [5]",
            [],
            InvalidPlanError,
            r"^plan.txt:2:1: invalid plan: .*'n1 bathe: at start \(warm\)' broken at time 3",
        ),
        ("0: (heat) [10]", [], InvalidPlanError, r"^plan.txt: invalid plan: found 'goal: \(done\)' broken"),
        ("0: (cool) [10]", [], InputError, r"^plan.txt:1:1: found action 'cool'"),
        ("0: (heat)", [], InputError, "found 'heat' used as an instantaneous action"),
        ("0: (unlock)\n1: (wait) [1]", [], InputError, "found 'wait' used as a durative action"),
    ],
)
def test_wrong_plans_and_specifications(steps, specs, kind, message):
    with pytest.raises(kind, match=message):
        house(steps, *specs)


def test_the_epsilon_after_an_instantaneous_action_is_passed_over():
    assert not house("0: (wait) [0.001]", init="(open)").stn.instances[0].durative


def test_without_time_there_is_no_proof():
    with pytest.raises(SolverError, match=r"undecided, expected a proof"):
        house("0: (draw) [2]\n0: (heat) [10]\n11: (bathe) [5]", timeout=1e-9)


# -- drawn plans -----------------------------------------------------------------------------------------------------


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

    @settings(max_examples=70, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
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
                assert allows(causal.plan, esterel.plan) == []
            return

    check()
    assert seen["orders alone"] > 10
    assert seen["esterel proved"] > 5


# -- examples and recorded plans -------------------------------------------------------------------------------------

SHIPPED = [
    (EXAMPLES / "two_sample_navigation", "problem.pddl", "plan.stn"),
    (EXAMPLES / "generator", "problem.pddl", "plan.stn"),
    (REPOSITORY / "benchmarks/domains/solar_rover", "problem.pddl", "plan-2.stn"),
    (REPOSITORY / "benchmarks/domains/robot_delivery", "problem-two-orders.pddl", "two-orders-10.stn"),
]


@pytest.mark.parametrize(("directory", "problem_file", "plan_file"), SHIPPED, ids=lambda one: getattr(one, "name", one))
def test_shipped_plans(directory, problem_file, plan_file):
    domain = read_domain(directory / "domain.pddl")
    files = directory / "domain.pddl", directory / problem_file, directory / plan_file
    plan = timed(*bare(*files))
    found = convert(domain, read_problem(files[1], domain), plan)
    assert found.check.answer is Answer.PROVED
    assert parse_stn(write_stn(found.stn)) == found.stn


def test_recorded_networks_are_those_of_the_transformer(dataset):
    """From the earliest schedules of the recorded plans, the transformer makes the recorded constraints again.

    Only the numbers of deadlines differ: those were taken some seconds after the problem was written.
    """
    directory = dataset / "robot-delivery"
    recorded = sorted(directory.glob("plan_*.stn"))
    assert recorded
    for path in recorded:
        problem_file = path.name.replace("plan", "problem").replace(".stn", ".pddl")
        files = directory / "domain.pddl", directory / problem_file, path
        plan = load_plan(*files)
        unbound, times = bare(*files)
        edges = esterel_edges(Original(unbound, times, Fraction(1, 1000)))
        made = Counter((one.source, one.target, one.weight) for one in edges if one.target != ZERO)
        nominal = {ParameterReference(one.name): one.nominal for one in plan.parameters}
        wanted = Counter(chain.from_iterable(_bounds(one, nominal) for one in plan.constraints))
        assert set(made) == set(wanted), path.name
        deadlines = {one.source for one in edges if one.target == ZERO}
        assert deadlines == {one.target for one in plan.constraints if one.source == ZERO and one.upper is not None}


def _bounds(constraint, nominal):
    """Both bounds at nominal values, without deadlines."""
    bounds = (constraint.lower, constraint.upper)
    lower, upper = (None if bound is None else bound.evaluate(nominal) for bound in bounds)
    yield constraint.source, constraint.target, lower
    if upper is not None and constraint.source != ZERO:
        yield constraint.target, constraint.source, -upper


def test_recorded_plans_become_proved_networks(dataset):
    directory = dataset / "robot-delivery"
    domain = read_domain(directory / "domain.pddl")
    for name in ("g01_w05", "g02_w10", "g03_w09"):
        problem_file = directory / f"problem_{name}.pddl"
        plan = timed(*bare(directory / "domain.pddl", problem_file, directory / f"plan_{name}.stn"))
        read = read_problem(problem_file, domain)
        causal, esterel = (convert(domain, read, plan, mode=mode) for mode in Mode)
        assert causal.tightened == ()
        assert esterel.check.answer is Answer.PROVED
        assert allows(causal.plan, esterel.plan) == []
