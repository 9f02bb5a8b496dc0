"""The scaling experiment: its plans, its runs by the real command and by a stand-in, its report."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import jsonschema
import pytest

import robust.bench
from robust.bench import figure4
from robust.bench.contenders import IRR, OPTIMAL, REGIONS, WIDEN
from robust.bench.figure4 import run_figure4
from robust.bench.figure4_instances import Instance, Origin, own_instance, recorded_instances
from robust.bench.figure4_work import CONTENDERS, CONTROLLABILITY, Figure4Task, _loss, do, unbounded
from robust.bench.run import Outcome
from robust.errors import InputError
from robust.irr.box import Box, Interval
from robust.irr.check import Answer
from robust.plan.load import load_plan
from tests.bench.conftest import EXAMPLES, rendered

SCHEMA = Path(robust.bench.__file__).parent / "schemas" / "bench-figure4.schema.json"


def checked(report):
    value = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    jsonschema.validate(value, json.loads(SCHEMA.read_text()))
    return value


def suite(tmp_path, *entries):
    """A data set with the shipped example in place of a delivery plan."""
    (tmp_path / "robot-delivery").mkdir(exist_ok=True)
    (tmp_path / "robot-delivery" / "instances.json").write_text(json.dumps(entries))
    return tmp_path


def navigation(**fields):
    directory = EXAMPLES / "two_sample_navigation"
    files = {key: str(directory / name) for key, name in (("domain", "domain.pddl"), ("problem", "problem.pddl"))}
    return {"instance": "navigation", "parameters": 2, **files, "plan": str(directory / "plan.stn"), **fields}


@pytest.mark.parametrize("parameters", [1, 4, 7])
def test_own_instances_have_their_parameters_and_are_valid(parameters, tmp_path):
    from robust.api import check  # noqa: PLC0415

    instance = own_instance(parameters, 1)
    assert instance == own_instance(parameters, 1) != own_instance(parameters, 2)
    options = [one.removeprefix("--parameter=") for one in instance.options]
    plan = load_plan(*instance.write(tmp_path), parameters=options)
    assert len(plan.parameters) == parameters == instance.parameters
    assert check(plan).answer is Answer.PROVED


def test_recorded_instances(tmp_path):
    [instance] = recorded_instances(suite(tmp_path, navigation()))
    assert (instance.name, instance.origin, instance.parameters) == ("navigation", Origin.RECORDED, 2)
    assert instance.texts[2] == (EXAMPLES / "two_sample_navigation" / "plan.stn").read_text()
    for wrong in (navigation(parameters="2"), navigation(plan=""), 3, navigation(instance=None)):
        with pytest.raises(InputError, match="entry 1: expected an object"):
            recorded_instances(suite(tmp_path, wrong))
    with pytest.raises(InputError, match="at least one instance"):
        recorded_instances(suite(tmp_path))
    with pytest.raises(InputError, match="nowhere"):
        recorded_instances(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"missing\.stn"):
        recorded_instances(suite(tmp_path, navigation(plan="missing.stn")))


def test_the_data_set_is_read(dataset):
    instances = recorded_instances(dataset)
    assert len(instances) == 27
    assert {one.parameters for one in instances} >= {4, 23}


def test_all_methods_by_the_real_command(tmp_path):
    plot, store = tmp_path / "plot.svg", tmp_path / "store"
    options = {"sizes": (), "limit": 120, "baseline_limit": 120, "store": store}
    report = run_figure4(suite(tmp_path, navigation()), **options, plot=plot)
    assert report.agrees
    assert report.limit == 120
    [row] = report.rows
    assert {row.outcome(one.name) for one in CONTENDERS} == {Outcome.COMPLETE}
    assert report.solved(Origin.RECORDED, IRR.name) == 1
    # The box that is known by hand, see conftest.navigation.
    assert row.runs["irr"]["box"] == {"to_ridge": ["30", "45"], "to_crater": ["30", "40"]}
    assert row.runs["widen"]["unbounded"] == []
    assert row.runs["project"]["polyhedra"] >= 1
    assert row.controllability["dynamic"] == "controllable"
    assert row.controllability["kept"] == 1
    value = checked(report)
    assert value["solved"][0]["methods"]["widen"] == 1
    shown = rendered(report.tables())
    assert "0 + 0 of 4" in shown
    assert "100.0 %" in shown
    assert plot.stat().st_size > 0
    again = run_figure4(tmp_path, **options)
    assert again.rows == report.rows
    assert f"{len(CONTENDERS) + 1} of {len(CONTENDERS) + 1} results are from {store}" in again.notes


def test_runs_that_are_late_or_fail(tmp_path, stand):
    stand("time.sleep(30)")
    late = run_figure4(suite(tmp_path, navigation()), sizes=(), limit=0.3, contenders=(WIDEN,), plot=tmp_path / "p.png")
    assert late.rows[0].outcome("widen") is Outcome.TIMEOUT
    assert not late.agrees
    assert late.rows[0].seconds("widen") is None
    checked(late)
    stand("sys.exit('broken')")
    failed = run_figure4(tmp_path, sizes=(), contenders=(OPTIMAL,))
    assert not failed.agrees
    assert "navigation, optimal: error: broken" in failed.notes
    rendered(failed.tables())
    # The others may be late: the paper's were.
    stand("time.sleep(30) if '--method' not in sys.argv else print(json.dumps(ANSWER))")
    mixed = run_figure4(tmp_path, sizes=(), baseline_limit=0.3, contenders=(WIDEN, REGIONS[0]))
    assert mixed.agrees
    assert mixed.rows[0].runs["widen"]["unbounded"] == ["above a"]
    checked(mixed)


def test_a_plan_that_cannot_be_read_is_a_failure(tmp_path):
    broken = tmp_path / "broken.stn"
    broken.write_text("nonsense")
    report = run_figure4(suite(tmp_path, navigation(plan=str(broken))), sizes=(), contenders=())
    assert not report.agrees
    assert report.failures[0].reason.startswith("InputError")
    assert checked(report)["rows"] == []


def test_a_box_that_is_not_dynamically_controllable(tmp_path):
    """A deadline by which `b` must end starts when `a` ends, but `b` has to start before that.

    By hand: b starts at 0 and ends at d_b, a ends at d_a, and d_b − 1 ≤ d_a − 1/2 …: see the constraints.
    """
    domain = """(define (domain two) (:requirements :durative-actions :duration-inequalities)
      (:predicates (done-a) (done-b))
      (:durative-action a :parameters () :duration (>= ?duration 0) :condition (and) :effect (at end (done-a)))
      (:durative-action b :parameters () :duration (>= ?duration 0) :condition (and) :effect (at end (done-b))))"""
    problem = "(define (problem p) (:domain two) (:init) (:goal (and (done-a) (done-b))))"
    plan = """parameter x default 10 lb 5 ub 15;
parameter y default 10 lb 5 ub 15;
durative-action instance a : (a);
durative-action instance b : (b);
c: a.end - a.start in [x, x];
c: b.end - b.start in [y, y];
c: a.start - .zero in [0, 0];
c: b.end - a.end in [0, 4];
"""
    # Start b so that it ends 0 to 4 after a: b must start at x + s − y for some s in [0, 4], and as x + s − y ≥ 0 is
    # known only later, some values of x and y have a start of b before a has ended that fits none of the others.
    instance = Instance("two", Origin.OWN, 2, (domain, problem, plan))
    found = do(Figure4Task(instance, CONTROLLABILITY, 60))
    assert found["status"] == "complete"
    assert (found["dynamic"], found["strong"]) == ("not controllable", "not controllable")
    assert 0 < found["kept"] < 1
    assert found["reason"]


def test_losses():
    box = Box(
        {
            "a": Interval(Fraction(0), Fraction(10)),
            "b": Interval(Fraction(0), None),
            "c": Interval(Fraction(0), None),
            "d": Interval(Fraction(1), Fraction(1)),
            "e": Interval(Fraction(0), Fraction(4)),
        }
    )
    part = Box(
        {
            "a": Interval(Fraction(5), Fraction(10)),
            "b": Interval(Fraction(0), Fraction(7)),
            "c": Interval(Fraction(0), Fraction(1000000)),
            "d": Interval(Fraction(1), Fraction(1)),
            "e": Interval(Fraction(0), Fraction(4)),
        }
    )
    assert _loss(box, part, {"c"}) == {"kept": 0.75, "bounded": 1, "cut": 1}
    assert unbounded(box) == ["above b", "above c"]
    assert unbounded(Box({"a": Interval(None, Fraction(1))})) == ["below a"]


def test_faces_that_only_the_domain_bounds(tmp_path):
    """x may be as long as the domain says, y only as long as the window is open."""
    domain = """(define (domain two) (:requirements :durative-actions :duration-inequalities :timed-initial-literals)
      (:predicates (done-a) (done-b) (window))
      (:durative-action a :parameters () :duration (<= ?duration 100) :condition (and) :effect (at end (done-a)))
      (:durative-action b :parameters () :duration (<= ?duration 100) :condition (over all (window))
        :effect (at end (done-b))))"""
    problem = """(define (problem p) (:domain two) (:init (window) (at 50 (not (window))))
      (:goal (and (done-a) (done-b))))"""
    plan = """parameter x default 10 lb 5;
parameter y default 10 lb 5;
durative-action instance a : (a);
durative-action instance b : (b);
c: a.end - a.start in [x, x];
c: b.end - b.start in [y, y];
c: b.start - .zero in [0, 0];
"""
    instance = Instance("two", Origin.OWN, 2, (domain, problem, plan))
    found = do(Figure4Task(instance, "widen", 60))
    assert found["box"] == {"x": ["5", "100"], "y": ["5", "50"]}
    assert (found["unbounded"], found["capped"]) == ([], ["above x"])


def test_wrong_options(tmp_path):
    for options, message in (
        ({"limit": 0.0}, "the limit is 0"),
        ({"baseline_limit": -1.0}, "the limit is -1"),
        ({"plot": Path("plot.xyz")}, "expected a name that ends in"),
        ({"sizes": ()}, "found no plan"),
        ({"sizes": (0,)}, "found 0 parameters"),
    ):
        with pytest.raises(InputError, match=message):
            run_figure4(**options)
    assert figure4.LIMIT == 10
