"""`bench figure17` and `figure18` on a few problems, and their statistics by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from importlib.resources import files
from math import ceil
from statistics import correlation, linear_regression

import jsonschema
import pytest

from robust.bench import k_intents_work
from robust.bench.k_intents import KIntentsReport, KIntentsRun, TeamExecution, report_of, run_k_intents
from robust.bench.k_intents_tables import improvement_cells, replan_cells, time_cells
from robust.bench.k_intents_work import KIntentsTask, do
from robust.bench.line_fit import LineFit
from robust.errors import InputError
from robust.pike_bridge.generators.k_intents import random_k_intents
from robust.pike_bridge.online.baselines.script import draw_script
from tests.bench.conftest import rendered
from tests.cli.running import command

FIGURES = ("figure17", "figure18")


def schema(figure):
    return json.loads(files("robust.bench").joinpath(f"schemas/bench-{figure}.schema.json").read_text())


@pytest.mark.parametrize("figure", FIGURES)
def test_a_few_problems(figure, tmp_path):
    plot, store = tmp_path / "plot.svg", tmp_path / "store"
    seen = []
    report = run_k_intents(
        figure=figure,
        problems=3,
        largest=20,
        plot=plot,
        store=store,
        on_result=lambda done, total, line: seen.append((done, total, line)),
    )
    assert report.agrees
    assert len(report.runs) == len(seen) == 3
    assert report.pike_failures == 0
    value = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    jsonschema.validate(value, schema(figure))
    assert [run.as_dict() for run in report_of(value).runs] == value["runs"]
    assert "3 problems of seed 0" in " ".join(rendered(report.tables()).split())
    assert plot.read_text().startswith("<?xml")


def test_both_figures_are_made_of_one_run(tmp_path):
    store = tmp_path / "store"
    first, second = (run_k_intents(figure=figure, problems=2, largest=10, store=store) for figure in FIGURES)
    assert first.runs == second.runs
    assert any("2 of 2 results are from" in note for note in second.notes)


@pytest.mark.parametrize("index", range(3))
def test_executions_of_a_problem_are_those_of_one_world(index):
    """PIKE never plans anew; Kirk is later by exactly its recoveries."""
    result = do(KIntentsTask(1, index, 30, "smt", None))
    pike, kirk = result["pike"], result["kirk"]
    assert (pike["outcome"], pike["replans"], pike["recovery"]) == ("succeeded", 0, "0")
    assert Fraction(kirk["time"]) - Fraction(pike["time"]) == Fraction(kirk["recovery"])
    assert 0 <= kirk["replans"] <= len(result["structure"])
    assert (kirk["replans"] == 0) == (kirk["recovery"] == "0")
    again = do(KIntentsTask(1, index, 30, "smt", None))
    assert [again[mode]["time"] for mode in ("pike", "kirk")] == [pike["time"], kirk["time"]]


def by_formula(seed, index, largest):
    """Re-plans, and PIKE's and Kirk's times, without any executive.

    Kirk guesses the first option of each choice. Each pair of choices takes its two activities and six times ε between
    them, the whole another ε.
    """
    problem = random_k_intents(seed, index, largest)
    plan = problem.instance.plan()
    script = draw_script(plan, f"{seed}/{index}")
    activities = {each.action: each for each in plan.network.activities}
    replans, recovery = 0, Fraction(0)
    time = (6 * len(problem.structure) + 1) * plan.epsilon
    for place in range(1, len(problem.structure) + 1):
        value = script.outcomes[f"y{place}"]
        for agent in "hr":
            done = activities[f"({agent}-{place}-{value})"]
            time += script.durations[done.target, done.action]
        if value != "1":
            replans += 1
            half = activities[f"(h-{place}-1)"].lower / 2
            recovery += ceil(half / plan.epsilon) * plan.epsilon
    return replans, time, time + recovery


@pytest.mark.parametrize("index", range(4))
def test_figures_by_formula(index):
    result = do(KIntentsTask(2, index, 40, "smt", None))
    found = (result["kirk"]["replans"], Fraction(result["pike"]["time"]), Fraction(result["kirk"]["time"]))
    assert found == by_formula(2, index, 40)


@pytest.mark.slow
@pytest.mark.parametrize("index", range(30))
def test_figures_of_many_problems_by_formula(index):
    result = do(KIntentsTask(3, index, 10_000, "smt", None))
    found = (result["kirk"]["replans"], Fraction(result["pike"]["time"]), Fraction(result["kirk"]["time"]))
    assert found == by_formula(3, index, 10_000)


def test_executions_that_take_too_long_are_left_out(tmp_path):
    report = run_k_intents(figure="figure18", problems=2, largest=10, limit=1e-6)
    assert [run.pike.outcome for run in report.runs] == ["timeout", "timeout"]
    assert report.agrees  # too late is not wrong
    assert report.compared == []
    assert "out of time: 2 problems" in rendered(report.tables())
    jsonschema.validate(json.loads(json.dumps(report.as_dict(), allow_nan=False)), schema("figure18"))


def test_a_success_that_is_none_is_said(monkeypatch):
    monkeypatch.setattr(k_intents_work, "execution_faults", lambda plan, executive: ("wrong",))
    report = run_k_intents(figure="figure17", problems=1, largest=4)
    assert report.runs[0].pike.outcome == "incorrect"
    assert not report.agrees
    assert report.pike_failures == 1


def execution(time, replans=0, recovery=0, seconds=0.0, outcome="succeeded"):
    return TeamExecution(outcome, Fraction(time), replans, Fraction(recovery), seconds)


RUNS = (
    KIntentsRun(0, (2,), execution(3, seconds=1.0), execution(4, 1, 1, 0.5)),
    KIntentsRun(1, (2, 3), execution(6), execution(8, 2, 2)),
    KIntentsRun(2, (3, 2), execution(6), execution(6)),
    KIntentsRun(3, (3, 2), execution(6), execution(6, outcome="failed")),
)


def made(*runs):
    return KIntentsReport("robust/bench-figure18/1", runs, (), len(runs), 0, 100, "smt", None, 1, True)


def test_what_is_saved():
    run = RUNS[0]
    assert run.improvement == 0.25
    assert run.improvement_over_pike == pytest.approx(1 / 3)
    assert run.computed_improvement == pytest.approx(1 - 4 / 4.5)
    assert run.free_improvement == pytest.approx(1 - 4 / 3.5)
    assert RUNS[1].wrong_guesses == Fraction(1, 2) + Fraction(2, 3)
    assert RUNS[1].intents == 6


def test_statistics_by_hand():
    report = made(*RUNS)
    assert not report.agrees  # one of Kirk's executions failed
    assert report.choices == [1, 2]
    assert report.mean(lambda run: run.kirk.replans).value == 1
    assert report.totals == pytest.approx(1 - 15 / 18)
    assert report.fit.slope == 0
    assert [cells[:3] for cells in replan_cells(report)] == [("1", "1", "1.00"), ("2", "2", "1.00")]
    assert time_cells(report)[1][:5] == ("2", "2", "6.00", "7.00", "12.5")
    assert improvement_cells(report)[0][1] == "16.7"


def test_pike_that_fails_counts():
    failed = replace(RUNS[0], pike=execution(3, outcome="failed"))
    assert made(failed).pike_failures == 1
    assert not made(failed).agrees
    assert made(replace(RUNS[0], pike=execution(3, replans=1))).pike_failures == 1


def test_a_line():
    points = [(1, 0), (1, 1), (2, 1), (3, 2), (4, 2), (5, 4)]
    fit = LineFit.of(points)
    slope, intercept = linear_regression(*zip(*points, strict=True))
    assert fit.slope == pytest.approx(slope)
    assert fit.intercept == pytest.approx(intercept)
    assert fit.r_squared == pytest.approx(correlation(*zip(*points, strict=True)) ** 2)
    # Student's t for four degrees of freedom is 2.776; the residual deviation over the spread is 0.5 / √(40/3) here.
    residual = sum((y - intercept - slope * x) ** 2 for x, y in points)
    spread = sum((x - 16 / 6) ** 2 for x, _ in points)
    assert fit.interval[1] - slope == pytest.approx(2.7764 * (residual / 4 / spread) ** 0.5, rel=1e-4)


def test_lines_through_too_little():
    assert LineFit.of([(1, 2), (1, 3)]) is None
    assert LineFit.of([(1, 2), (2, 4)]) == LineFit(2.0, 0.0, 1.0, None)
    assert LineFit.of([(1, 2), (2, 2), (3, 2)]).r_squared == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"problems": 0}, "problems is 0"),
        ({"largest": 1}, "expected at least 2"),
        ({"limit": 0.0}, "positive number of seconds"),
        ({"reasoner": "smtt"}, "unknown reasoner 'smtt'"),
    ],
)
def test_wrong_options(options, message):
    with pytest.raises(InputError, match=message):
        run_k_intents(figure="figure17", **options)


@pytest.mark.parametrize("figure", FIGURES)
def test_the_commands(figure, tmp_path):
    store = tmp_path / "store"
    ended = command("bench", figure, "--problems", "2", "--largest", "6", "--store", store, "--json")
    assert ended.code == 0
    value = json.loads(ended.out)
    jsonschema.validate(value, schema(figure))
    assert (value["problems"], value["largest"], value["reasoner"]) == (2, 6, "smt")
    assert command("bench", figure, "--problems", "2", "--largest", "6", "--store", store).code == 0
    assert command("bench", figure, "--backend", "nobody").code == 2
