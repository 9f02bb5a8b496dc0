"""Domain, problem, plan and specifications put together: what comes out, and what does not fit."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from robust import reading
from robust.errors import InputError
from robust.plan import load, model, parameters, stn
from robust.plan.pddl.reader import parse_domain, parse_problem
from tests.execute.plans import TASKS, TWO_TASKS
from tests.plan.building import DURATION, EVERYTHING, TEXTS, TOUR, at, between, equal, number, reference, refused

PROBLEM = TWO_TASKS.replace("(= (need a) 3) ", "")
PLAN = (TEXTS / "mission.stn").read_text(encoding="utf-8")
MOVE = "durative-action instance n0 : (move r1 a b);\nc: n0.end - n0.start in [5, 5];\n"
SYNTH_PLAN = f"parameter speed default 9;\nparameter n0.rate default 1.5;\n{MOVE}"
STOCK, NEED = model.Fluent("stock"), model.Fluent("need", ("b",))
FILES = {"domain": TASKS, "problem": PROBLEM, "plan": PLAN}
MEASURED = TOUR.replace("(:init", "(:init (= (distance b a) 8) (= (distance b hub) 9)")
SYNTH = {"domain": EVERYTHING, "problem": MEASURED, "plan": SYNTH_PLAN}


def build(*specs: str, nominal_needed: bool = True, **texts: str) -> model.ParametrizedPlan:
    texts = FILES | texts
    domain = parse_domain(texts["domain"])
    problem, plan = parse_problem(texts["problem"], domain), stn.parse_stn(texts["plan"], "mission.stn")
    return load.assemble(domain, problem, plan, parameters.parse_specs(specs), nominal_needed=nominal_needed)


def test_parts() -> None:
    plan = build()
    n0, n1, n2 = plan.instances
    assert plan.name == "mission"
    assert plan.parameters == (model.Parameter("pause", Fraction(3), Fraction(2), Fraction(1), Fraction(10)),)
    assert list(map(str, plan.instances)) == ["(fetch b)", "(work a)", "(call a)"]
    assert plan.constraints == (
        at(n0.start, 0),
        between(n0.start, n0.end, 2, 2),
        between(n1.start, n1.end, reference("pause"), reference("pause")),
        between(n0.end, n1.start, Fraction(1, 1000)),
        between(n1.end, n2.start, None, Fraction(15, 2)),
    )
    assert plan.initial_atoms == {model.Atom("ready", ("a",)), model.Atom("open")}
    assert plan.initial_fluents == {STOCK: number(10), NEED: number(4)}
    assert [literal.time for literal in plan.timed_literals] == [60]
    assert len(plan.goal) == 2
    assert build("pause,default=4", plan=PLAN.replace("default 3 ", "")).nominal == {"pause": 4}
    literal = plan.timed_literals[0].point
    assert plan.time_points == (model.ZERO, n0.start, n0.end, n1.start, n1.end, n2.start, literal)


def test_varied_durations_replace_equalities_only() -> None:
    (duration,) = build("d=duration:n0").instance["n0"].durations
    assert (duration.condition, duration.text) == (equal(DURATION, reference("d")), "(= ?duration d)")
    plan = PLAN.replace("[pause, pause]", "[3, 3]").replace("parameter pause default 3 weight 2 lb 1 ub 10;", "")
    varied, plain = build("duration:n1", plan=plan), build()
    assert varied.instance["n1"].durations == plain.instance["n1"].durations
    assert varied.nominal == {"dur_n1": 3}
    twice = TASKS.replace("(= ?duration 2)", "(and (>= ?duration 2) (<= ?duration 2))")
    assert len(build(domain=twice).instance["n0"].durations) == 2
    (varied_twice,) = build("d=duration:n0", domain=twice).instance["n0"].durations
    assert (varied_twice.condition, varied_twice.text) == (duration.condition, duration.text)
    in_the_plan = build(plan=PLAN.replace("[2, 2]", "[pause, pause]"))
    assert in_the_plan.instance["n0"].durations == plain.instance["n0"].durations


def test_parameters_without_nominal_values() -> None:
    """The message says what to type; regions and optimal boxes need none."""
    plan = PLAN.replace("default 3 ", "")
    without = build("start:n2", plan=plan, nominal_needed=False)
    assert not without.has_nominal
    for parameter, name, nominal in zip(without.parameters, ("pause", "start_n2"), (1, 0), strict=True):
        assert (parameter.name, parameter.nominal, parameter.has_nominal) == (name, nominal, False), "within its bounds"
        assert parameter.percent(Fraction(3)) is None
    for given, option in (((), "start:n2,default=4"), (("start:n2,default=4",), "pause,default=2")):
        with pytest.raises(InputError, match=f"--parameter {option.split('=')[0]}="):
            build(*(given or ["start:n2"]), plan=plan)
    assert build("start:n2,default=4", "pause,default=2", plan=plan).nominal == {"pause": 2, "start_n2": 4}
    synthesised = build(**{**SYNTH, "plan": MOVE}, nominal_needed=False)
    assert [parameter.name for parameter in synthesised.parameters] == ["speed", "n0.rate"]


def test_varied_initial_values_and_synthesis_parameters_in_the_plan_or_as_options() -> None:
    plan = build("fluent:(stock),lb=0", "use=fluent:(need b)")
    assert plan.initial_fluents == {STOCK: reference("stock"), NEED: reference("use")}
    assert plan.nominal == {"pause": 3, "stock": 10, "use": 4}
    (effect,) = plan.instance["n0"].numeric_effects
    assert NEED in effect.expression.variables, "though no action writes it"
    for plan, options in ((SYNTH_PLAN, ()), (MOVE, ("speed,default=9", "n0.rate,default=1.5,lb=0"))):
        built = build(*options, **{**SYNTH, "plan": plan})
        assert built.nominal == {"speed": 9, "n0.rate": Fraction(3, 2)}
        assert built.instance["n0"].continuous_effects[0].rate == reference("n0.rate").scaled(Fraction(-1, 2))


NO_SPEED = "no nominal value for parameter 'speed' of domain everything"
NO_NEED = ["no initial value of (need a)", "the goal (>= (need a) 1) reads it"]
# What is changed to what, in the files about tasks or about everything, and what is said; more is in tests/recordings.
MISFITS = [
    (FILES, "default 3 ", "", ["mission.stn:1:11", "'pause'", "without a nominal value", "default=VALUE"]),
    (FILES, "lb 1 ub 10;", "; parameter spare default 1;", ["mission.stn:1:48", "'spare' without a use", "remove"]),
    (FILES, "(work a)", "(work a b)", ["mission.stn:3:26", "work"]),
    (FILES, "(done b)", "(>= (need a) 1)", NO_NEED),
    (SYNTH, "parameter speed default 9;", "", [NO_SPEED, "speed,default=", "'parameter speed default VALUE;'"]),
    (SYNTH, "parameter n0.rate default 1.5;", "", ["'n0.rate' of action move of instance n0", "n0.rate default VALUE"]),
    (SYNTH, "n0.rate", "n0.rat", ["mission.stn:2:11", "'n0.rat' without a use", "did you mean 'n0.rate'?"]),
]


@pytest.mark.parametrize(("files", "old", "new", "parts"), MISFITS)
def test_misfit(files: dict[str, str], old: str, new: str, parts: list[str]) -> None:
    changed = {name: files[name].replace(old, new) for name in ("problem", "plan")}
    refused(lambda: build(**{**files, **changed}), "mission.stn", parts)


def test_plans_built_by_a_program_are_checked() -> None:
    domain = parse_domain(TASKS)
    problem, plan = parse_problem(PROBLEM, domain), stn.parse_stn(PLAN)
    end = plan.instances[1].end
    elsewhere = stn.STNConstraint(model.TimePoint(model.TimePointKind.END, "n9"), model.ZERO, None, None)
    undeclared = stn.STNConstraint(end, model.ZERO, model.ParameterReference("paus"), None)
    reversed_bounds = stn.STNConstraint(end, model.ZERO, Fraction(3, 2), Fraction(1))
    for change, message in (
        ({"constraints": (elsewhere,)}, "time point 'n9.end'"),
        ({"constraints": (undeclared,)}, "bound 'paus', expected a declared parameter; did you mean 'pause'"),
        ({"constraints": (reversed_bounds,)}, "lower bound 1.5 above upper bound 1"),
        ({"parameters": (stn.ParameterDeclaration("pause", Fraction(0)),)}, "weight 0 for parameter 'pause'"),
        ({"instances": plan.instances * 2}, "2 declarations of instance 'n0'"),
        ({"parameters": plan.parameters * 2}, "2 declarations of parameter 'pause'"),
        ({"instances": (), "constraints": ()}, "empty plan"),
    ):
        refused(lambda change=change: load.assemble(domain, problem, replace(plan, **change)), "", [message])


def test_load_plan(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("domain.pddl", "problem.pddl", "mission_3.stn", "parameters.toml")]
    options = "[parameters.endurance]\nfluent = '(stock)'\nlower = 0.1\n"
    for path, text in zip(paths, (TASKS, PROBLEM, PLAN, options), strict=True):
        path.write_text(text, encoding="utf-8")
    domain, problem, mission, file = paths
    plan = reading.load_plan(domain, str(problem), mission, parameters=["start:n0"], parameter_file=file)
    assert plan.name == "mission_3"
    assert plan.nominal == {"pause": 3, "endurance": 10, "start_n0": 0}
    assert plan.parameters[1].lower == Fraction(1, 10)
    file.write_text("[parameters.pause]\nweight = 3\n", encoding="utf-8")
    with pytest.raises(InputError, match="'pause' twice"):
        reading.load_plan(domain, problem, mission, parameters=["pause,lb=2"], parameter_file=file)
