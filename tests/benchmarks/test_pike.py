"""The figures about plans with choices: executions by formula, statistics by hand, and what may differ."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import ceil

import pytest

from benchmarks.generators.pike import random_k_intents
from benchmarks.pike import figure17_18
from benchmarks.pike.baselines import draw_script
from benchmarks.pike.figure17_18 import FIGURE18, Figure18Report, KIntentsRun, KIntentsTask, TeamExecution, run_problem
from benchmarks.pike.figure20b import LatencyTask, measure_latency, run_execution
from robust.smt.limits import Deadline
from tests.benchmarks.conftest import checked, rendered, run

FIGURES = ("figure17", "figure18")


# -- figures 17 and 18 -------------------------------------------------------------------------------------------------


def test_both_figures_are_made_of_one_run(tmp_path):
    first, second = (run(figure, problems=2, largest=10, store=tmp_path / "store") for figure in FIGURES)
    assert first.rows == second.rows
    assert any("2 of 2 results are from" in note for note in second.notes)


@pytest.mark.parametrize("index", range(3))
def test_executions_of_a_problem_are_those_of_one_world(index):
    """PIKE never plans anew; Kirk is later by exactly its recoveries."""
    result = run_problem(KIntentsTask(1, index, 30, "smt", None))
    pike, kirk = result.pike, result.kirk
    assert (pike.outcome, pike.replans, pike.recovery) == ("succeeded", 0, 0)
    assert kirk.time - pike.time == kirk.recovery
    assert 0 <= kirk.replans <= len(result.structure)
    assert (kirk.replans == 0) == (kirk.recovery == 0)
    again = run_problem(KIntentsTask(1, index, 30, "smt", None))
    assert (again.pike.time, again.kirk.time) == (pike.time, kirk.time)


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


@pytest.mark.parametrize(
    ("seed", "index", "largest"),
    [
        *((2, index, 40) for index in range(4)),
        *(pytest.param(3, index, 10_000, marks=pytest.mark.slow) for index in range(30)),
    ],
)
def test_figures_by_formula(seed, index, largest):
    result = run_problem(KIntentsTask(seed, index, largest, "smt", None))
    assert (result.kirk.replans, result.pike.time, result.kirk.time) == by_formula(seed, index, largest)


def test_executions_that_take_too_long_are_left_out():
    report = run("figure18", problems=2, largest=10, limit=1e-6)
    assert [each.pike.outcome for each in report.rows] == ["timeout", "timeout"]
    assert report.agrees  # too late is not wrong
    assert report.compared == []
    assert "out of time: 2 problems" in rendered(report.tables)
    checked(report)


def test_a_success_that_is_none_is_said(monkeypatch):
    monkeypatch.setattr(figure17_18, "execution_faults", lambda plan, executive: ("wrong",))
    report = run("figure17", problems=1, largest=4)
    assert report.rows[0].pike.outcome == "incorrect"
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
    return Figure18Report(FIGURE18, FIGURE18.options(problems=len(runs), largest=100), None, runs)


def test_what_is_saved():
    first = RUNS[0]
    assert first.improvement == 0.25
    assert first.improvement_over_pike == pytest.approx(1 / 3)
    assert first.computed_improvement == pytest.approx(1 - 4 / 4.5)
    assert first.free_improvement == pytest.approx(1 - 4 / 3.5)
    assert RUNS[1].wrong_guesses == Fraction(1, 2) + Fraction(2, 3)
    assert RUNS[1].intents == 6


def test_statistics_by_hand():
    report = made(*RUNS)
    assert not report.agrees  # one of Kirk's executions failed
    assert list(report.by_choices) == [1, 2]
    assert report.mean(lambda each: each.kirk.replans).value == 1
    assert report.saved_of_totals == pytest.approx(1 - 15 / 18)
    assert report.fit.slope == 0
    assert [cells[:3] for cells in report.replans().rows] == [("1", "1", "1.00"), ("2", "2", "1.00")]
    assert report.times.rows[1][:5] == ("2", "2", "6.00", "7.00", "12.5")
    assert report.improvements().rows[0][1] == "16.7"


def test_pike_that_fails_counts():
    failed = replace(RUNS[0], pike=execution(3, outcome="failed"))
    assert made(failed).pike_failures == 1
    assert not made(failed).agrees
    assert made(replace(RUNS[0], pike=execution(3, replans=1))).pike_failures == 1


# -- figures 20a and 21 ------------------------------------------------------------------------------------------------


def test_all_contenders_decide_the_same():
    report = run("figure20a", instances=2, limit=120, backends=("oracle", "sat", "bdd", "pitms"))
    assert all(each.solved for each in report.rows), [each.message for each in report.rows]
    assert report.agrees
    wrong = replace(report.rows[0], satisfiable=not report.rows[0].satisfiable)
    other = replace(report, rows=(wrong, *report.rows[1:]))
    assert other.contradicted == ["random_0_000"]
    assert not other.agrees
    assert "contradicting answers: random_0_000" in rendered(other.tables)


# -- figure 20b --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def latencies(tmp_path_factory):
    """Of the first five plans, two admit a correct execution."""
    seen = []
    plot = tmp_path_factory.mktemp("plots") / "plot.svg"
    found = run(
        "figure20b", backends=("smt", "bdd"), problems=5, plot=plot, on_result=lambda *progress: seen.append(progress)
    )
    assert [done for done, _, _ in seen] == [1, 2, 3, 4, 5, 1, 2, 3, 4]
    assert plot.stat().st_size > 0
    return found


def test_a_few_plans(latencies):
    assert latencies.agrees
    admitting = ("random_0_000", "random_0_004")
    assert latencies.facts.admitting == admitting
    assert [(each.instance, each.backend) for each in latencies.rows] == [
        (instance, backend) for instance in admitting for backend in ("smt", "bdd")
    ]
    for each in latencies.rows:
        assert each.executed
        assert 0 < each.slowest < 60
        assert each.preparation_seconds > 0
        assert len(each.decided) == each.decisions > 0
    first, second = latencies.rows[:2]
    assert first.decided == second.decided
    assert len(first.step_seconds) == len(second.step_seconds)
    value = checked(latencies)
    text = rendered(latencies.tables)
    assert "5 plans of seed 0: 2 of 5 decided ones admit a correct execution" in text
    again = latencies.experiment.read(value)
    assert [each.slowest for each in again.rows] == [each.slowest for each in latencies.rows]


def test_different_decisions_are_a_failure(latencies):
    *others, last = latencies.rows
    decided = (*last.decided[:3], "something else", *last.decided[4:])
    wrong = replace(latencies, rows=(*others, replace(last, decided=decided)))
    assert wrong.differences == ["random_0_004: smt and bdd differ from decision 4 on"]
    assert not wrong.agrees
    assert "differ from decision 4 on" in rendered(wrong.tables)
    # What a time-out has decided may be less, but not other.
    late = replace(last, outcome="timeout", decided=last.decided[:3])
    assert replace(latencies, rows=(*others, late)).agrees
    assert not replace(latencies, rows=(*others, replace(last, decided=last.decided[:3]))).agrees
    assert not replace(latencies, rows=(*others, replace(late, decided=("other",)))).agrees


def test_a_failed_process_is_a_failure(latencies):
    failed = run_execution(LatencyTask(0, 0, "no such back end", 60.0))
    assert "unknown reasoner" in failed.message
    assert not replace(latencies, rows=(failed, *latencies.rows)).agrees


def test_measured_executions():
    late = measure_latency(0, backend="bdd", deadline=Deadline.after(0))
    assert (late.outcome, late.step_seconds) == ("timeout", ())
    found = measure_latency(53)
    assert found.outcome == "succeeded"
    assert min(*found.step_seconds, *found.wake_seconds, found.preparation_seconds) > 0
