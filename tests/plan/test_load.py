"""Domain, problem, plan and specifications put together: what comes out, and what does not fit."""

import json
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from robust.errors import InputError
from robust.plan.load import assemble, load_plan
from robust.plan.model import (
    ZERO,
    Atom,
    Comparison,
    Duration,
    Expression,
    Fluent,
    Parameter,
    ParameterReference,
    ParametrizedPlan,
    Relation,
    TemporalConstraint,
    TimePoint,
    TimePointKind,
)
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.stn import ParameterDeclaration, STNConstraint, parse_stn

DOMAIN = """\
(define (domain rovers)
 (:requirements :typing :durative-actions :fluents :timed-initial-literals :duration-inequalities)
 (:types rover place)
 (:predicates (at ?r - rover ?p - place) (sent))
 (:functions (charge ?r - rover) (rate ?r - rover) (distance ?a ?b - place) (score))
 (:durative-action go
  :parameters (?r - rover ?a ?b - place)
  :duration (= ?duration (distance ?a ?b))
  :condition (and (at start (at ?r ?a)) (at start (>= (charge ?r) (* (rate ?r) ?duration))))
  :effect (and (at start (not (at ?r ?a))) (at end (at ?r ?b))
               (at end (decrease (charge ?r) (* (rate ?r) ?duration)))))
 (:durative-action rest
  :parameters (?r - rover)
  :duration (and (>= ?duration 1) (<= ?duration 10))
  :condition (and)
  :effect (at end (increase (charge ?r) 1)))
 (:action send
  :parameters ()
  :precondition (and)
  :effect (sent)))
"""

SYNTH_DOMAIN = """\
(define (domain pumps)
 (:requirements :typing :durative-actions :fluents)
 (:types pump)
 (:synth-parameters ?limit)
 (:functions (level ?p - pump))
 (:durative-action fill
  :parameters (?p - pump)
  :synth-parameters (?flow)
  :duration (>= ?duration 0)
  :condition (at end (<= (level ?p) ?limit))
  :effect (increase (level ?p) (* #t ?flow))))
"""

PROBLEM = """\
(define (problem one) (:domain rovers)
 (:objects r1 - rover a b - place)
 (:init (at r1 a) (= (charge r1) 100) (= (rate r1) 2) (= (distance a b) 5) (at 30 (at r1 b)))
 (:goal (and (sent) (>= (charge r1) 10))))
"""

SYNTH_PROBLEM = """\
(define (problem one) (:domain pumps) (:objects p1 - pump) (:init (= (level p1) 0)) (:goal (>= (level p1) 3)))
"""

PLAN = """\
parameter pause default 3 weight 2 lb 1 ub 10;
durative-action instance n0 : (GO R1 a b);
durative-action instance n1 : (rest r1);
action instance n2 : (send);
c: n0.start - .zero in [0, 0];
c: n0.end - n0.start in [5, 5];
c: n1.end - n1.start in [pause, pause];
c: n1.start - n0.end in [1/1000, inf];
c: n2 - n1.end in [-inf, 7.5];
"""

SYNTH_PLAN = """\
parameter limit default 9;
parameter n0.flow default 1.5;
durative-action instance n0 : (fill p1);
c: n0.end - n0.start in [2, 2];
"""

CHARGE = Fluent("charge", ("r1",))


def build(
    *specs: str, domain: str = DOMAIN, problem: str = PROBLEM, plan: str = PLAN, name: str = "mission.stn"
) -> ParametrizedPlan:
    parsed = parse_domain(domain)
    return assemble(parsed, parse_problem(problem, parsed), parse_stn(plan, name), parse_specs(specs))


def number(value: int | str) -> Expression:
    return Polynomial.constant(Fraction(value))


def reference(name: str) -> Expression:
    return Polynomial.variable(ParameterReference(name))


def point(kind: TimePointKind, instance: str) -> TimePoint:
    return TimePoint(kind, instance)


START, END, INSTANT = TimePointKind.START, TimePointKind.END, TimePointKind.INSTANT


def test_parts() -> None:
    plan = build()
    n0, n1, n2 = plan.instances
    assert plan.name == "mission"
    assert plan.parameters == (Parameter("pause", Fraction(3), Fraction(2), Fraction(1), Fraction(10)),)
    assert [str(one) for one in plan.instances] == ["(go r1 a b)", "(rest r1)", "(send)"]
    assert plan.constraints == (
        TemporalConstraint(ZERO, n0.start, number(0), number(0)),
        TemporalConstraint(n0.start, n0.end, number(5), number(5)),
        TemporalConstraint(n1.start, n1.end, reference("pause"), reference("pause")),
        TemporalConstraint(n0.end, n1.start, number("1/1000"), None),
        TemporalConstraint(n1.end, n2.start, None, number("15/2")),
    )
    assert plan.initial_atoms == {Atom("at", ("r1", "a"))}
    assert plan.initial_fluents[CHARGE] == number(100)
    assert [literal.time for literal in plan.timed_literals] == [30]
    assert len(plan.goal) == 2
    assert set(plan.time_points) >= {point(START, "n0"), point(END, "n1"), point(INSTANT, "n2"), ZERO}


def test_varied_duration_replaces_equality() -> None:
    (duration,) = build("d=duration:n0").instance["n0"].durations
    expected: Expression = Polynomial.variable(Duration())
    assert duration.condition == Comparison(expected - reference("d"), Relation.EQUAL)
    assert duration.text == "(= ?duration d)"


def test_varied_duration_keeps_inequalities() -> None:
    plan = PLAN.replace("[pause, pause]", "[3, 3]").replace("parameter pause default 3 weight 2 lb 1 ub 10;", "")
    varied = build("duration:n1", plan=plan)
    assert varied.instance["n1"].durations == build().instance["n1"].durations
    assert varied.nominal == {"dur_n1": 3}


def test_duration_of_the_plan_keeps_equality() -> None:
    plan = PLAN.replace("[5, 5]", "[pause, pause]")
    assert build(plan=plan).instance["n0"].durations == build().instance["n0"].durations


def test_varied_initial_values() -> None:
    plan = build("fluent:(charge r1),lb=0", "speed=fluent:(rate r1)")
    assert plan.initial_fluents[CHARGE] == reference("charge_r1")
    assert plan.initial_fluents[Fluent("rate", ("r1",))] == reference("speed")
    assert plan.nominal == {"pause": 3, "charge_r1": 100, "speed": 2}


def test_static_fluent_is_varied_where_it_is_read() -> None:
    """A rate that no action writes still appears as a fluent in what reads it."""
    (effect,) = build("fluent:(rate r1)").instance["n0"].numeric_effects
    assert Fluent("rate", ("r1",)) in effect.expression.variables


def test_synthesis_parameters() -> None:
    plan = build(domain=SYNTH_DOMAIN, problem=SYNTH_PROBLEM, plan=SYNTH_PLAN)
    assert plan.nominal == {"limit": 9, "n0.flow": Fraction(3, 2)}
    (effect,) = plan.instance["n0"].continuous_effects
    assert effect.rate == reference("n0.flow")


def test_synthesis_parameter_from_an_option() -> None:
    plan = "".join(SYNTH_PLAN.splitlines(keepends=True)[2:])
    options = ("limit,default=9", "n0.flow,default=1.5,lb=0")
    assert build(*options, domain=SYNTH_DOMAIN, problem=SYNTH_PROBLEM, plan=plan).nominal == {
        "limit": 9,
        "n0.flow": Fraction(3, 2),
    }


def test_default_from_an_option() -> None:
    plan = PLAN.replace("default 3 ", "")
    assert build("pause,default=4", plan=plan).nominal == {"pause": 4}


MISFITS = [
    (
        {"plan": PLAN.replace("default 3 ", "")},
        ["mission.stn:1:11", "'pause'", "without a nominal value", "default=VALUE"],
    ),
    (
        {"plan": f"parameter spare default 1;\n{PLAN}"},
        ["mission.stn:1:11", "'spare' without a use", "remove the declaration"],
    ),
    ({"plan": PLAN.replace("(rest r1)", "(sleep r1)")}, ["mission.stn:3:26", "sleep"]),
    ({"plan": PLAN.replace("(rest r1)", "(rest r2)")}, ["mission.stn:3:26", "r2"]),
    ({"plan": PLAN.replace("(rest r1)", "(rest)")}, ["mission.stn:3:26", "rest"]),
    ({"plan": PLAN.replace("(rest r1)", "(rest a)")}, ["mission.stn:3:26", "a"]),
    ({"plan": "action instance n0 : (rest r1);"}, ["mission.stn:1:17", "rest"]),
    (
        {"problem": PROBLEM.replace("(= (rate r1) 2)", "")},
        [
            "mission.stn:2:26",
            "no initial value of (rate r1)",
            "instance n0 (go r1 a b) reads it",
            "add (= (rate r1) VALUE)",
        ],
    ),
    (
        {"problem": PROBLEM.replace("(>= (charge r1) 10)", "(>= (score) 10)")},
        ["mission.stn", "no initial value of (score)", "the goal (>= (score) 10) reads it"],
    ),
]
SYNTH = {"domain": SYNTH_DOMAIN, "problem": SYNTH_PROBLEM}
SYNTH_MISFITS = [
    (
        {"plan": SYNTH_PLAN.replace("parameter limit default 9;", "")},
        [
            "no nominal value for parameter 'limit' of domain pumps",
            "'parameter limit default VALUE;'",
            "limit,default=",
        ],
    ),
    (
        {"plan": SYNTH_PLAN.replace("parameter n0.flow default 1.5;", "")},
        ["'n0.flow' of action fill of instance n0", "'parameter n0.flow default VALUE;'"],
    ),
    (
        {"plan": SYNTH_PLAN.replace("n0.flow", "n0.flaw")},
        ["mission.stn:2:11", "'n0.flaw' without a use", "did you mean 'n0.flow'?"],
    ),
]


@pytest.mark.parametrize(("inputs", "parts"), [*MISFITS, *((SYNTH | more, parts) for more, parts in SYNTH_MISFITS)])
def test_misfit(inputs: dict[str, str], parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        build(**inputs)
    message = str(caught.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_plans_built_by_a_program_are_checked() -> None:
    domain = parse_domain(DOMAIN)
    problem, plan = parse_problem(PROBLEM, domain), parse_stn(PLAN)
    elsewhere = STNConstraint(point(END, "n9"), ZERO, None, None)
    undeclared = STNConstraint(point(END, "n1"), ZERO, ParameterReference("paus"), None)
    reversed_bounds = STNConstraint(point(END, "n1"), ZERO, Fraction(3, 2), Fraction(1))
    cases = [
        (replace(plan, constraints=(elsewhere,)), "time point 'n9.end'"),
        (replace(plan, constraints=(undeclared,)), "bound 'paus', expected a declared parameter.*'pause'"),
        (replace(plan, constraints=(reversed_bounds,)), "lower bound 1.5 above upper bound 1"),
        (replace(plan, parameters=(ParameterDeclaration("pause", Fraction(0)),)), "weight 0 for parameter 'pause'"),
        (replace(plan, instances=plan.instances * 2), "2 declarations of instance 'n0'"),
        (replace(plan, parameters=plan.parameters * 2), "2 declarations of parameter 'pause'"),
        (replace(plan, instances=(), constraints=()), "empty plan"),
    ]
    for bad, message in cases:
        with pytest.raises(InputError, match=message):
            assemble(domain, problem, bad)


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    texts = {"domain.pddl": DOMAIN, "problem.pddl": PROBLEM, "mission_3.stn": PLAN}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return {name.partition(".")[0].partition("_")[0]: tmp_path / name for name in texts}


def test_load_plan(files: dict[str, Path], tmp_path: Path) -> None:
    options = tmp_path / "parameters.toml"
    options.write_text("[parameters.endurance]\nfluent = '(charge r1)'\nlower = 0.1\n", encoding="utf-8")
    plan = load_plan(
        files["domain"], str(files["problem"]), files["mission"], parameters=["start:n0"], parameter_file=options
    )
    assert plan.name == "mission_3"
    assert plan.nominal == {"pause": 3, "endurance": 100, "start_n0": 0}
    assert plan.parameters[1].lower == Fraction(1, 10)


def test_file_and_option_about_the_same(files: dict[str, Path], tmp_path: Path) -> None:
    options = tmp_path / "parameters.toml"
    options.write_text("[parameters.pause]\nweight = 3\n", encoding="utf-8")
    with pytest.raises(InputError, match="'pause' twice"):
        load_plan(*files.values(), parameters=["pause,lb=2"], parameter_file=options)


def test_recorded_plans_load(dataset: Path) -> None:
    recorded = json.loads((dataset / "recorded-results.json").read_text(encoding="utf-8"))
    scaling = json.loads((dataset / "robot-delivery" / "instances.json").read_text(encoding="utf-8"))
    for entry in [*recorded, *scaling]:
        plan = load_plan(*(dataset / entry[key] for key in ("domain", "problem", "plan")))
        assert plan.instances
        assert plan.name == Path(entry["plan"]).stem
        if "irr_box" in entry:
            assert set(plan.nominal) == set(entry["irr_box"])


def test_import_is_light() -> None:
    code = "import sys, robust.plan; print('robust.plan.pddl.reader' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
