"""Figures 3, 4 and 5 and the studies of growth: every comparison by stand-ins, and plans that are known by hand."""

import json
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest

from benchmarks.engine.measure import Ending
from benchmarks.generators.sizes import envelope_sum, time_points, unordered_instance, write_instance, write_unordered
from benchmarks.irr import figure4, growth
from benchmarks.irr.contenders import IRR, OPTIMAL, RECORDED_BOX, REGIONS, WIDEN
from benchmarks.irr.figure3 import CONTENDERS
from benchmarks.irr.figure4 import DeliveryInstance, Origin
from benchmarks.irr.figure5 import SCHEDULES
from robust import Answer, Box, InputError, Interval, check, envelope
from robust.reading import load_plan
from tests.benchmarks.conftest import example, navigation, promised_region, rendered, run


def recorded(**fields: Any) -> dict[str, Any]:
    irr = {"status": "ok", "wall_s": 5.0, "first_widening_s": 0.4, "checks": 3}
    return navigation("toy_01_1", **{"irr": irr, "irr_box": {"a": ["0", "2"]}, "irr_order": ["a"], **fields})


def delivery(**fields: Any) -> list[Any]:
    """The shipped example in place of a delivery plan."""
    return [{"instance": "navigation", "parameters": 2, **example(), **fields}]


SAYS = "print(json.dumps({'error': {'message': 'p.pddl:3: wrong'}})); sys.exit(%d)"
NO_ENVELOPE = "not that of `robust envelope --json`"
NO_REGION = "not that of `robust region --json`"
REGION = {"contenders": REGIONS[:1]}
TWO_POINTS = {"series": (replace(growth.POINTS, sizes=(2,)),), **REGION}
TWO_REFUELS = {"series": (replace(growth.MORE_REFUELS, sizes=(2,)),)}
PLAN = {"delivery": delivery(), "sizes": ()}
BASELINES = PLAN | {"contenders": (WIDEN, *REGIONS[:1]), "limit": 60, "baseline_limit": 0.5}
LATE_BASELINES = "'--method' in sys.argv or time.sleep(60); BOX['upper'] = 'inf'"


@pytest.mark.parametrize(
    ("name", "script", "options", "status", "said"),
    [
        ("recorded", "sys.exit('first line\\nrobust: p.pddl:3: wrong')", {}, "error", "robust: p.pddl:3: wrong"),
        ("recorded", "os.abort()", {}, "error", "exit code -6 without a message"),
        ("recorded", SAYS % 4, {}, "error", "p.pddl:3: wrong"),
        ("recorded", "print('{'); sys.exit()", {}, "error", NO_ENVELOPE),
        ("recorded", "ANSWER = []", {}, "error", NO_ENVELOPE),
        ("recorded", "ANSWER['status'] = 'fine'", {}, "error", "'fine' is not a valid Ending"),
        ("recorded", "del ANSWER['checks']", {}, "error", "KeyError: 'checks'"),
        ("recorded", "BOX['lower'] = 'x'", {}, "error", "found 'x', expected a number"),
        ("recorded", "BOX['lower'] = 3", {}, "error", "TypeError"),
        ("recorded", "ANSWER['parameters'] = 3", {}, "error", "AttributeError"),
        ("recorded", "ANSWER.update(status='invalid', reason='[goal] breaks')", {}, "invalid", "[goal] breaks"),
        ("figure3", SAYS % 4, REGION, "unsupported", "p.pddl:3: wrong"),
        ("figure3", SAYS % 2, REGION, "error", "p.pddl:3: wrong"),
        ("figure3", "sys.exit('broken')", {"contenders": (RECORDED_BOX,)}, "error", "broken"),
        ("figure3", "del ANSWER['base']", REGION, "error", NO_REGION),
        ("figure3", "ANSWER['status'] = 'finished'", REGION, "error", NO_REGION),
        ("figure5", "STEPS.clear()", {}, "complete", "left out: navigation (zero or infinite width)"),
        ("figure5", "sys.exit(1)", {}, "error", "left out: navigation (error)"),
        ("backends", "sys.exit('broken')", TWO_POINTS, "error", "project: error: broken"),
        ("scaling", "sys.exit('broken')", TWO_REFUELS, "error", "broken"),
        ("scaling", "time.sleep(60)", TWO_REFUELS | {"limit": 0.5}, "timeout", "timeout"),
        ("figure4", "sys.exit('broken')", BASELINES, "error", "navigation, project: error: broken"),
        ("figure4", LATE_BASELINES, BASELINES, "timeout", '"unbounded": ["above a"]'),
        ("figure4", "time.sleep(60)", PLAN | {"contenders": (WIDEN,), "limit": 0.5}, "timeout", ""),
    ],
)
def test_failures_are_rows(trial, tmp_path, name, script, options, status, said):
    """What fails is wrong; what is late is not, except for exact widening in figure 4. A figure of nothing is drawn."""
    instances = (navigation(),) if name in {"recorded", "figure3", "figure5"} else ()
    report = trial(name, script, *instances, **options, plot=tmp_path / "plot.png")
    plotted = status != "error" or "broken" in script
    printed = json.dumps(report.as_dict(), ensure_ascii=False)
    assert f'"status": "{status}"' in printed
    assert said in printed
    assert (report.complete, report.failures) == (True, ())
    late_widening = options.get("contenders") == (WIDEN,) and status == "timeout"
    assert report.agrees == (status in {"complete", "timeout", "unsupported"} and not late_widening)
    assert name != "recorded" or said[:8] in rendered(report.tables)
    if plotted:
        report.plot()
        assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


def test_domains_and_curves(trial, tmp_path):
    """IRR alone is given the order of turns."""
    plot = tmp_path / "plot.png"
    script = "time.sleep(60) if NAME == 'cvc5' else None\nassert ('--order=a' in sys.argv) == (NAME == 'irr')"
    instances = (recorded(ccmmz={"status": "ok", "wall_s": 700.0}), navigation("other", irr=None, irr_box=None))
    report = trial("figure3", script, *instances, limit=60, own_limits={"cvc5": 0.5}, jobs=2, plot=plot)
    report.plot()
    assert report.groups == ("toy", "other")
    curves = {curve.name: curve for curve in report.curves("toy")}
    recordings = {"recorded-irr", "recorded-irr-first", "recorded-ccmmz"}
    assert set(curves) == {*(one.name for one in CONTENDERS if one is not RECORDED_BOX), "irr-first", *recordings}
    assert curves["irr-first"].times <= curves["irr"].times
    assert (curves["cvc5"].times, curves["recorded-ccmmz"].times) == ((), (700.0,))
    assert [curves["recorded-ccmmz"].solved_within(limit) for limit in (600, 700)] == [0, 1]
    assert {curve.name for curve in report.curves("other") if curve.recorded and not curve.times} == recordings
    value = report.as_dict()
    assert value["rows"][0]["runs"]["cvc5"]["status"] == "timeout"
    assert "cvc5 0.5 s" in value["notes"][0]
    assert plot.stat().st_size > 0


PROMISED = {"irr_box": {"a": ["1/3", "inf"]}}
ASKED = "assert sys.argv[5] == '--at=a=1/3:inf'; ANSWER['verdict'] = "
ENDLESS = "BOX['upper'] = 'inf'"
BOXES = (IRR, WIDEN, OPTIMAL, REGIONS[0])


@pytest.mark.parametrize(
    ("script", "fields", "contenders", "expected", "agrees"),
    [
        (ASKED + "'proved'", PROMISED, (RECORDED_BOX,), {"recorded_box_proved": True}, True),
        (ASKED + "'refuted'", PROMISED, (RECORDED_BOX,), {"recorded_box_proved": False}, False),
        (ASKED + "'unknown'", PROMISED, (RECORDED_BOX,), {"recorded_box_proved": None}, True),
        ("", {"irr_box": {"a": ["0", "4"]}}, BOXES, {"recorded_box_in_region": False}, False),
        ("", {"irr_box": {"b": ["0", "1"]}}, REGIONS[:1], {"recorded_box_in_region": False}, False),
        ("BOX['upper'] = '4' if NAME == 'irr' else '2'", {}, (IRR, *REGIONS[:1]), {"irr_in_region": False}, False),
        (
            "BOX['upper'] = 'inf' if NAME == 'widen' else '2'",
            {},
            (WIDEN, *REGIONS[:1]),
            {"widening_in_region": False},
            False,
        ),
        (
            "BOX['upper'] = '7/2' if NAME == 'optimal' else '2'",
            {},
            (OPTIMAL, *REGIONS[:1]),
            {"optimal_in_region": False},
            False,
        ),
        ("", {"ccmmz_box": {"a": ["0", "2"]}}, (OPTIMAL,), {"widths": "equal"}, True),
        ("", {"ccmmz_box": {"a": ["0", "3/2"]}}, (OPTIMAL,), {"widths": "recorded not optimal"}, True),
        ("", {"ccmmz_box": {"a": ["0", "5/2"]}}, (OPTIMAL,), {"widths": "recorded wider"}, False),
        ("", {"ccmmz_box": {"a": ["0", "inf"]}}, (OPTIMAL,), {"widths": "recorded wider"}, False),
        (ENDLESS, {"ccmmz_box": {"a": ["0", "2"]}}, (OPTIMAL,), {"widths": "recorded not optimal"}, True),
        (ENDLESS, {"ccmmz_box": {"a": ["0", "inf"]}}, (OPTIMAL,), {"widths": "equal"}, True),
    ],
)
def test_boxes_are_compared(trial, script, fields, contenders, expected, agrees):
    """With the region, with a check of the recorded box, and with each other."""
    report = trial("figure3", script, recorded(**fields), navigation("no_box", irr_box=None), contenders=contenders)
    checks = report.as_dict()["rows"][0]["checks"]
    assert expected.items() <= checks.items()
    assert {name for name in checks if checks[name] is False} == {name for name in expected if expected[name] is False}
    assert (report.agrees, "NO" in rendered(report.tables)) == (agrees, False in expected.values())


def test_poorest_best_and_the_claim(trial, tmp_path):
    (tmp_path / "b.stn").write_text("", encoding="utf-8")
    instances = (navigation("x_1"), navigation("x_2", plan=str(tmp_path / "b.stn")))
    script = "STEPS[0]['share'] = 0.75 if 'b.stn' in sys.argv[4] else 0.25"
    report = trial("figure5", script, *instances, schedules=SCHEDULES[:1])
    (fifty,) = report.summary(SCHEDULES[0], [50])
    assert (fifty.poorest, fifty.best, fifty.running) == (0.25, 0.75, 2)
    assert (report.claim_holds(SCHEDULES[0]), report.agrees) == (False, True)  # the claim is reported, not required
    assert "does not hold for 2 runs; the poorest is x_1 with 25.0%" in report.notes[0]


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_what_is_too_late_is_not_tried_any_larger(trial, tmp_path, jobs):
    ladders = [
        replace(growth.POINTS, name=name, sizes=sizes) for name, sizes in (("first", (2, 4, 6)), ("second", (2,)))
    ]
    script = "'positions' in sys.argv and time.sleep(60)"
    report = trial("encodings", script, limit=2, series=tuple(ladders), plot=tmp_path / "plot.svg", jobs=jobs)
    report.plot()
    endings = {(row.series, row.contender, row.size): row.run and row.run.status for row in report.rows}
    assert endings["first", "positions", 2] is endings["second", "positions", 2] is Ending.TIMEOUT
    assert endings["first", "relational", 6] is Ending.COMPLETE
    assert report.agrees  # too late is not wrong
    if jobs == 1:
        statuses = [row["status"] for row in report.as_dict()["rows"][:6]]
        assert statuses == ["complete", "timeout", "complete", "not run", "complete", "not run"]
    text = " ".join(rendered(report.tables).split())
    assert "out of time" in text
    assert "stopped at 2 s" in text


def test_all_sizes_can_be_generated_and_read(tmp_path):
    for series in (growth.MORE_REFUELS, growth.MORE_PARAMETERS):
        for refuels, parameters in (growth.NUMBERS[series.name](size) for size in series.sizes):
            plan = load_plan(*write_instance(tmp_path, refuels, parameters))
            assert (len(plan.parameters), len(plan.instances)) == (parameters, refuels + 1)
    for size in growth.POINTS.sizes:
        plan = load_plan(*growth.WRITERS["points"](tmp_path / "points", size))
        assert time_points(len(plan.instances) - 1) == size
    for jobs, parameters in ((0, 1), (2, 0), (2, 3)):
        with pytest.raises(ValueError, match="expected"):
            unordered_instance(jobs, parameters)
    for jobs, parameters in ((1, 1), (3, 2)):
        result = envelope(load_plan(*write_unordered(tmp_path, jobs, parameters)), method="widen")
        assert result.status.value == "complete"
        lowers, uppers = zip(*result.box.ranges.values(), strict=True)
        assert (set(lowers), sum(uppers)) == ({0}, envelope_sum(parameters))
        assert promised_region(parameters).contains_box(result.box)


@pytest.mark.parametrize("parameters", [1, 4, 7])
def test_own_instances_have_their_parameters_and_are_valid(parameters, tmp_path):
    instance = figure4.own_instance(parameters, 1)
    assert instance == figure4.own_instance(parameters, 1) != figure4.own_instance(parameters, 2)
    options = [one.removeprefix("--parameter=") for one in instance.options]
    plan = load_plan(*instance.write(tmp_path), parameters=options)
    assert len(plan.parameters) == parameters == instance.parameters
    assert check(plan).answer is Answer.PROVED


def test_recorded_instances(make_suite, tmp_path, dataset):
    [instance] = figure4.recorded_instances(make_suite(delivery=delivery()))
    assert (instance.name, instance.origin, instance.parameters) == ("navigation", Origin.RECORDED, 2)
    with open(example()["plan"], encoding="utf-8") as file:
        assert instance.texts[2] == file.read()
    with pytest.raises(InputError, match=r"instances.json: Expected .* at `\$\[0\]"):
        figure4.recorded_instances(make_suite(delivery=delivery(parameters="2")))
    with pytest.raises(InputError, match="nowhere"):
        figure4.recorded_instances(tmp_path / "nowhere")
    counts = [one.parameters for one in figure4.recorded_instances(dataset)]
    assert (len(counts), {4, 23} <= set(counts)) == (27, True)


def test_the_known_box_and_its_controllability(make_suite):
    limits = {"limit": 300, "baseline_limit": 300, "contenders": (IRR, WIDEN, REGIONS[0])}
    report = run("figure4", suite=make_suite(delivery=delivery()), sizes=(), **limits)
    assert report.agrees
    [row] = report.rows
    # The box that is known by hand, see conftest.navigation.
    assert row.runs["irr"].box == {"to_ridge": ("30", "45"), "to_crater": ("30", "40")}
    assert row.runs["widen"].unbounded == ()
    assert row.runs["project"].polyhedra >= 1
    assert (row.controllability.dynamic, row.controllability.kept) == ("controllable", 1)
    assert report.as_dict()["solved"][0]["methods"]["widen"] == 1


def test_a_plan_that_cannot_be_read_is_a_failure(trial, tmp_path):
    (tmp_path / "broken.stn").write_text("nonsense", encoding="utf-8")
    report = trial("figure4", "", delivery=delivery(plan=str(tmp_path / "broken.stn")), sizes=(), contenders=())
    assert (report.agrees, report.rows) == (False, ())
    assert "plan.stn:1:1: found 'nonsense', expected" in report.failures[0].reason


DOMAIN = """(define (domain two) (:requirements :durative-actions :duration-inequalities :timed-initial-literals)
  (:predicates (done-a) (done-b) (window))
  (:durative-action a :parameters () :duration {0} :condition (and) :effect (at end (done-a)))
  (:durative-action b :parameters () :duration {0} :condition {1} :effect (at end (done-b))))"""
PROBLEM = "(define (problem p) (:domain two) (:init {}) (:goal (and (done-a) (done-b))))"
STEPS = """parameter x default 10 lb 5{0}; parameter y default 10 lb 5{0};
durative-action instance a : (a); durative-action instance b : (b);
c: a.end - a.start in [x, x]; c: b.end - b.start in [y, y];
"""


def two(duration: str, condition: str, facts: str, most: str, constraints: str) -> DeliveryInstance:
    """Two actions whose durations are parameters."""
    texts = (DOMAIN.format(duration, condition), PROBLEM.format(facts), STEPS.format(most) + constraints)
    return DeliveryInstance("two", Origin.OWN, 2, texts)


def test_a_box_that_is_not_dynamically_controllable():
    """Start b so that it ends 0 to 4 after a.

    b must start at x + s − y for some s in [0, 4], and as x + s − y ≥ 0 is known only later, some values of x and y
    have a start of b before a has ended that fits none of the others.
    """
    constraints = "c: a.start - .zero in [0, 0];\nc: b.end - a.end in [0, 4];\n"
    instance = two("(>= ?duration 0)", "(and)", "", " ub 15", constraints)
    judged = figure4.do(instance, figure4.CONTROLLABILITY, 60).assessment
    assert (judged.status, judged.dynamic, judged.strong) == ("complete", "not controllable", "not controllable")
    assert 0 < judged.kept < 1
    assert judged.reason


def test_faces_that_only_the_domain_bounds():
    """x may be as long as the domain says, y only as long as the window is open."""
    facts = "(window) (at 50 (not (window)))"
    instance = two("(<= ?duration 100)", "(over all (window))", facts, "", "c: b.start - .zero in [0, 0];\n")
    widened = figure4.do(instance, WIDEN, 60).run
    assert widened.box == {"x": ("5", "100"), "y": ("5", "50")}
    assert (widened.unbounded, widened.capped) == ((), ("above x",))


def test_losses():
    def box(lower: int, **uppers: int | None) -> Box:
        lowers = {"a": lower, "d": 1}
        ends = {name: None if upper is None else Fraction(upper) for name, upper in uppers.items()}
        return Box({name: Interval(Fraction(lowers.get(name, 0)), upper) for name, upper in ends.items()})

    whole, kept = box(0, a=10, b=None, c=None, d=1, e=4), box(5, a=10, b=7, c=1000000, d=1, e=4)
    assert figure4.loss(whole, kept, {"c"}) == {"kept": 0.75, "bounded": 1, "cut": 1}
    assert figure4.unbounded(whole) == ("above b", "above c")
    assert figure4.unbounded(Box({"a": Interval(None, Fraction(1))})) == ("below a",)
