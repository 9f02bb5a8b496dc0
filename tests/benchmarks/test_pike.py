"""The figures about plans with choices: executions by formula, statistics by hand, and what may differ."""

from dataclasses import replace
from fractions import Fraction
from math import ceil

import pytest

from benchmarks.pike import figure17_18
from benchmarks.pike.baselines import draw_script
from benchmarks.pike.figure17_18 import FIGURE18, SAVINGS, Figure18Report, KIntentsRun, TeamExecution
from benchmarks.pike.figure20b import measure_latency, run_execution
from robust.smt.limits import Deadline
from tests.benchmarks.conftest import checked, rendered, run


def execution(time, replans=0, recovery=0, seconds=0.0, outcome="succeeded"):
    return TeamExecution(outcome, Fraction(time), replans, Fraction(recovery), seconds)


def by_formula(seed, index, largest):
    """Re-plans, and PIKE's and Kirk's times, without any executive.

    Kirk guesses the first option of each choice. Each pair of choices takes its two activities and six times ε between
    them, the whole another ε.
    """
    problem = figure17_18.random_k_intents(seed, index, largest)
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
def test_executions_by_formula(seed, index, largest):
    """PIKE never plans anew; Kirk is later by exactly its recoveries."""
    result = figure17_18.run_problem(seed, index, largest, "smt")
    replans, time, later = by_formula(seed, index, largest)
    assert replace(result.pike, seconds=0.0) == execution(time)
    assert replace(result.kirk, seconds=0.0) == execution(later, replans, later - time)


def test_both_figures_are_made_of_one_run_and_leave_out_what_takes_too_long(tmp_path, monkeypatch):
    first, second = (run(name, problems=2, largest=10, store=tmp_path / "store") for name in ("figure17", "figure18"))
    assert first.rows == second.rows
    assert any("2 of 2 results are from" in note for note in second.notes)
    late = run("figure18", problems=2, largest=10, limit=1e-6)
    assert [each.pike.outcome for each in late.rows] == ["timeout", "timeout"]
    assert (late.agrees, late.compared) == (True, [])  # too late is not wrong
    assert "out of time: 2 problems" in rendered(late.tables)
    checked(late)
    monkeypatch.setattr(figure17_18, "execution_faults", lambda plan, executive: ("wrong",))
    wrong = run("figure17", problems=1, largest=4)
    assert (wrong.rows[0].pike.outcome, wrong.agrees, wrong.pike_failures) == ("incorrect", False, 1)


RUNS = (
    KIntentsRun(0, (2,), execution(3, seconds=1.0), execution(4, 1, 1, 0.5)),
    KIntentsRun(1, (2, 3), execution(6), execution(8, 2, 2)),
    KIntentsRun(2, (3, 2), execution(6), execution(6)),
    KIntentsRun(3, (3, 2), execution(6), execution(6, outcome="failed")),
)


def report_of(*runs):
    return Figure18Report(FIGURE18, FIGURE18.options(problems=len(runs), largest=100), None, runs)


def test_statistics_by_hand():
    shares = [one.share(RUNS[0]) for one in SAVINGS.values()]
    assert shares == pytest.approx([0.25, 1 / 3, 1 - 4 / 4.5, 1 - 4 / 3.5])
    assert (RUNS[1].wrong_guesses, RUNS[1].intents) == (Fraction(1, 2) + Fraction(2, 3), 6)
    report = report_of(*RUNS)
    assert not report.agrees  # one of Kirk's executions failed
    assert (list(report.by_choices), report.mean(lambda each: each.kirk.replans).value) == ([1, 2], 1)
    assert (report.saved_of_totals, report.fit.slope) == (pytest.approx(1 - 15 / 18), 0)
    assert [cells[:3] for cells in report.replans.rows] == [("1", "1", "1.00"), ("2", "2", "1.00")]
    assert report.times.rows[1][:5] == ("2", "2", "6.00", "7.00", "12.5")
    assert report.improvements.rows[0][1] == "16.7"
    for failed in ({"outcome": "failed"}, {"replans": 1}):
        wrong = report_of(replace(RUNS[0], pike=execution(3, **failed)))
        assert (wrong.agrees, wrong.pike_failures) == (False, 1)


def test_all_contenders_decide_the_same():
    report = run("figure20a", instances=1, limit=120, backends=("oracle", "sat", "bdd", "pitms"))
    assert all(each.solved for each in report.rows), [each.message for each in report.rows]
    assert report.agrees
    wrong = replace(report.rows[0], satisfiable=not report.rows[0].satisfiable)
    other = replace(report, rows=(wrong, *report.rows[1:]))
    assert (other.contradicted, other.agrees) == (["random_0_000"], False)
    assert "contradicting answers: random_0_000" in rendered(other.tables)
    failed = replace(report.rows[0], satisfiable=None, message="found no dd")
    broken = replace(report, rows=(failed, replace(report.rows[1], satisfiable=None), *report.rows[2:]))
    table = broken.compilation[0]
    assert [row[table.headings.index("out of time")] for row in table.rows] == ["0", "1", "0", "0"], "an error is none"
    assert "1 plan of seed 0" in rendered(broken.tables)


def test_plans_that_are_feasible_in_many_ways():
    report = run("figure20a", instances=1, seed=7, feasible=True, limit=120, backends=("pitms",))
    assert report.agrees
    assert [each.instance for each in report.rows] == ["feasible_7_000"]
    assert {each.prime_implicants for each in report.rows} == {177172312909223106183168}
    assert report.facts.plans[0].activities == 76


@pytest.fixture(scope="module")
def latencies(tmp_path_factory):
    """Of the first two plans, one admits a correct execution."""
    seen = []
    plot = tmp_path_factory.mktemp("plots") / "plot.svg"
    options = {"backends": ("smt", "bdd"), "problems": 2, "plot": plot}
    report = run("figure20b", **options, on_result=lambda *progress: seen.append(progress[0]))
    assert seen == [1, 2, 1, 2]
    report.plot()
    assert plot.stat().st_size > 0
    return report


def test_a_few_plans(latencies):
    assert latencies.agrees
    pairs = [("random_0_000", "smt"), ("random_0_000", "bdd")]
    assert [(each.instance, each.backend) for each in latencies.rows] == pairs
    assert latencies.facts.admitting == ("random_0_000",)
    for each in latencies.rows:
        assert each.executed
        assert 0 < each.slowest < 60
        assert each.preparation_seconds > 0
        assert len(each.decided) == each.decisions > 0
    for line in latencies.panels()[0].series[1:]:
        assert [share for _, share in line.points] == [0, 1], "a line, though there is one execution"
    first, second = latencies.rows
    assert (first.decided, len(first.step_seconds)) == (second.decided, len(second.step_seconds))
    assert "2 plans of seed 0: 1 of 2 decided ones admit a correct execution" in rendered(latencies.tables)
    again = latencies.experiment.read(checked(latencies))
    assert [each.slowest for each in again.rows] == [each.slowest for each in latencies.rows]
    failed = run_execution(0, 0, "no such back end", 60.0)
    assert "unknown reasoner" in failed.message
    assert not replace(latencies, rows=(failed, *latencies.rows)).agrees


@pytest.mark.parametrize(
    ("outcome", "kept", "then", "agrees"),
    [
        ("succeeded", slice(None), (), True),
        ("succeeded", slice(3), (), False),
        ("timeout", slice(3), (), True),  # what a time-out has decided may be less, but not other
        ("timeout", slice(3), ("other",), False),
    ],
)
def test_different_decisions_are_a_failure(latencies, outcome, kept, then, agrees):
    *others, last = latencies.rows
    other = replace(last, outcome=outcome, decided=(*last.decided[kept], *then))
    report = replace(latencies, rows=(*others, other))
    assert report.agrees == agrees
    assert report.differences == ([] if agrees else ["random_0_000: smt and bdd differ from decision 4 on"])
    assert ("differ from decision 4 on" in rendered(report.tables)) is not agrees


def test_measured_executions():
    late = measure_latency(0, backend="bdd", deadline=Deadline.after(0))
    assert (late.outcome, late.step_seconds) == ("timeout", ())
    measured = measure_latency(53)
    assert measured.outcome == "succeeded"
    assert min(*measured.step_seconds, *measured.wake_seconds, measured.preparation_seconds) > 0
