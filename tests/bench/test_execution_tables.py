"""Tables 1 and 2: the report against counting by hand, and short runs with a planner that knows one plan."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import jsonschema
import pytest

import robust.bench
from robust.bench import execution_runs
from robust.bench.execution_runs import run_table, uncertain_rules, uncertain_specs
from robust.bench.execution_statistics import Pairing, Proportion
from robust.bench.execution_tables import DREEX, EXECUTORS, TABLE1, TABLE2, ExecutionReport, ExecutionRow, share_of
from robust.errors import InputError
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.plan.timed import parse_timed_plan
from tests.bench.conftest import rendered
from tests.cli.running import command

SCHEMAS = Path(robust.bench.__file__).parent / "schemas"


def checked(report):
    value = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    name = f"bench-table{report.design.number}.schema.json"
    jsonschema.validate(value, json.loads((SCHEMAS / name).read_text()))
    return value


def row(executor, problem, succeeded, replans=0, *, column="1 parameter", promises=0, broken=0):
    return ExecutionRow(
        column, executor, problem, 0, succeeded, replans, promises, broken, 0.1, "" if succeeded else "x"
    )


def report(*rows, **fields):
    settings = {
        "problems": 1,
        "runs": 1,
        "planner": "aries",
        "planner_s": 7.0,
        "drain": False,
        "seed": 0,
        "battery": None,
    }
    values = {"failures": (), "complete": True, **fields}
    return ExecutionReport(TABLE1, (DREEX, "blex:0", "blex:10"), rows, settings=settings, **values)


# -- the report --------------------------------------------------------------------------------------------------------


def test_the_papers_figures():
    for design, columns in ((TABLE1, 5), (TABLE2, 1)):
        assert len(design.columns) == columns
        assert tuple(design.paper) == EXECUTORS
        assert {len(cells) for cells in design.paper.values()} == {columns}
        for column in design.columns:
            shares = [design.paper_cell(one, column).coverage for one in EXECUTORS]
            assert max(shares) == shares[0]
            assert shares[1:] == sorted(shares[1:])
    assert TABLE1.paper_cell("blex:40", "3 parameters").coverage == 34.7
    assert TABLE1.paper_cell("blex:20", "5 parameters").replans == 1.9
    assert TABLE2.paper_cell(DREEX, "battery").coverage == 99.2
    assert (share_of(DREEX), share_of("blex:30")) == (None, Fraction(3, 10))


def test_cells_by_hand():
    made = report(
        row(DREEX, "a", True, 1),
        row(DREEX, "b", True),
        row(DREEX, "c", False, 4),
        row("blex:10", "a", False),
        row("blex:10", "b", True, 2),
        row("blex:10", "c", False),
        row("blex:10", "d", True),  # not in a pair
    )
    mine, other = made.cell(DREEX, "1 parameter"), made.cell("blex:10", "1 parameter")
    assert (mine.coverage, mine.replans.value, mine.against) == (Proportion(2, 3), 0.5, None)
    assert (other.coverage, other.replans.value) == (Proportion(2, 4), 1)
    assert other.against == Pairing(first=1, second=0, both=1, neither=1)
    assert made.cell("blex:0", "1 parameter") is made.cell(DREEX, "2 parameters") is None
    assert (made.is_above("1 parameter"), made.is_above("2 parameters")) == (True, None)
    assert made.has_few_replans("1 parameter") is False
    assert not made.agrees
    value = checked(made)
    assert value["columns"][0]["cells"]["blex:10"]["p_value"] == 1
    assert value["columns"][0]["cells"]["blex:10"]["paper_coverage"] == 24.5
    shown = rendered(made.tables())
    assert "66.7 % [21–94] / 92.2 %" in shown
    assert "1 : 0, 1.0000" in shown
    assert "1 parameter: DREEX re-plans 0.3 times or more" in " ".join(shown.split())


def test_claims():
    good = report(row(DREEX, "a", True), row("blex:0", "a", False))
    assert good.agrees
    assert not report(row(DREEX, "a", True), row("blex:0", "a", True)).agrees
    assert not report(row(DREEX, "a", True), row("blex:0", "a", False), complete=False).agrees
    assert not report(row(DREEX, "a", True), row("blex:0", "a", False), failures=(("case", "no"),)).agrees
    broken = report(row(DREEX, "a", True, promises=3, broken=1), row("blex:0", "a", False))
    assert not broken.agrees
    assert "broken promise: dreex, a, seed 0" in broken.notes
    assert "3 plans had to succeed" in broken.notes[1]
    assert checked(broken)["agrees"] is False
    checked(report())


# -- what is uncertain -------------------------------------------------------------------------------------------------


def test_the_longest_steps_are_uncertain_first():
    assert [one.subject for one in uncertain_specs(1, 2)] == ["prepare_step6", "prepare_step5"]
    assert [rule.name for rule in uncertain_rules(1, 5).rules] == [f"prepare_step{i}" for i in (6, 5, 4, 3, 2)]
    for rule in uncertain_rules(1, 2).rules:
        assert (rule.distribution, rule.numbers) == ("normal", {"deviation": 70, "minimum": 30})
    [rule] = uncertain_rules(2, 1).rules
    assert (rule.name, rule.numbers["deviation"]) == ("battery_use", Fraction(13, 2))
    assert len(uncertain_specs(2, 1)) == 12


# -- runs --------------------------------------------------------------------------------------------------------------


def known_plan():
    """The plan for the nearer order, as early as it goes."""
    lines = []
    time = Fraction(0)

    def act(text, duration):
        nonlocal time
        lines.append(f"{time}: ({text}) [{duration}]")
        time += duration + Fraction(1, 1000)

    act("move robot1 dock1 shelf", 20)
    act("collect robot1 spindle1_1 shelf", 15)
    act("move robot1 shelf base_station", 15)
    for i in range(6, 0, -1):
        begin = time + Fraction(6 - i, 1000)  # apart, because all take from the battery
        lines.append(f"{begin}: (prepare_step{i} robot1 spindle1_1 base_station) [{110 + 10 * i}]")
    time += 170 + Fraction(1, 1000)
    act("assemble robot1 spindle1_1 base_station level0", 40)
    act("move robot1 base_station ring_station", 35)
    act("mount robot1 spindle1_1 ring_station level0 level1", 35)
    act("move robot1 ring_station gate1", 60)
    act("deliver robot1 spindle1_1 order1 gate1 level1", 24)
    return parse_timed_plan("\n".join(lines))


class OnePlan:
    """Knows the first plan, and nothing else."""

    name = "one-plan"

    def __init__(self):
        self.asked = 0

    def solve(self, domain, problem, deadline):
        self.asked += 1
        if any(str(atom) == "(robot_at robot1 dock1)" for atom in problem.atoms):
            return PlannerAnswer(self.name, PlannerStatus.SOLVED, known_plan(), 0.0)
        return PlannerAnswer(self.name, PlannerStatus.NO_PLAN, None, 0.0, "knows no other plan")


@pytest.mark.parametrize(("table", "columns"), [(1, (1, 3)), (2, None)])
def test_short_runs(table, columns, monkeypatch, tmp_path):
    planner = OnePlan()
    monkeypatch.setattr(execution_runs, "create_planner", lambda _name: planner)
    store = tmp_path / "store"
    lines = []
    options = {"problems": 3, "columns": columns, "planner": "one-plan", "executors": (DREEX, "blex:0", "blex:30")}
    made = run_table(table, **options, store=store, on_result=lambda _done, _total, line: lines.append(line))
    assert made.complete
    assert made.failures == ()
    assert len(made.rows) == 3 * 3 * len(columns or (1,))
    assert made.broken_promises == ()
    # Without another plan, BLEX(0) fails as soon as anything deviates; what DREEX accepts it also executes.
    assert not any(one.succeeded for one in made.rows if one.executor == "blex:0")
    assert any(one.promises for one in made.rows if one.executor == DREEX)
    for one in made.rows:
        assert one.succeeded == (one.reason == "")
        assert one.promises == 0 or one.executor == DREEX
    assert len(lines) == 3 * len(columns or (1,))
    value = checked(made)
    rendered(made.tables())
    asked = planner.asked
    again = run_table(table, **options, store=store)
    assert again.rows == made.rows
    assert planner.asked == asked
    assert value["settings"]["problems"] == 3


def test_no_plan_to_begin_with(monkeypatch):
    class Nobody(OnePlan):
        def solve(self, domain, problem, deadline):
            return PlannerAnswer(self.name, PlannerStatus.TIMEOUT, None, 1.0, "too late")

    monkeypatch.setattr(execution_runs, "create_planner", lambda _name: Nobody())
    made = run_table(1, problems=1, columns=(1,), executors=(DREEX, "blex:60"))
    assert [(one.succeeded, one.reason) for one in made.rows] == [(False, "timeout: too late")] * 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"problems": 0}, "problems is 0"),
        ({"problems": 101}, "problems is 101"),
        ({"runs": 0}, "runs is 0"),
        ({"columns": (6,)}, "found column 6, expected 1 to 5"),
        ({"executors": ("blex:0",)}, "expected dreex and then"),
        ({"executors": (DREEX, "blex:5")}, "expected dreex and then"),
        ({"planner": "nobody"}, "found planner 'nobody'"),
    ],
)
def test_wrong_options(options, message):
    with pytest.raises(InputError, match=message):
        run_table(1, **options)
    with pytest.raises(InputError, match="found table 3"):
        run_table(3)


# -- the commands ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "driver", "expected"),
    [
        (("table1", "--parameters", "2", "--stop"), "execution_runs.run_table", {"columns": (2,), "drain": False}),
        (("table2", "--battery", "400.5"), "execution_runs.run_table", {"battery": Fraction(801, 2), "drain": None}),
        (("figure4", "--baseline-limit", "1/2"), "figure4.run_figure4", {"baseline_limit": 0.5, "limit": 10.0}),
        (
            ("conversions", "--drawn", "3"),
            "conversions.run_conversions",
            {"drawn": 3, "delivery": 50, "limit": 60.0},
        ),
    ],
)
def test_options_reach_the_drivers(arguments, driver, expected, monkeypatch, tmp_path):
    seen = {}

    def stand_in(*_arguments, on_result, **options):
        on_result(1, 1, "one")
        seen.update(options)
        return report(row(DREEX, "a", True), row("blex:0", "a", options["jobs"] == 2))

    monkeypatch.setattr(f"robust.bench.{driver}", stand_in)
    store = tmp_path / "store"
    ended = command("bench", *arguments, "--store", store, "--cluster", "tcp://here:1", "--json")
    assert (ended.code, ended.err) == (0, "")
    assert json.loads(ended.out)["agrees"] is True
    assert {"store": store, "cluster": "tcp://here:1", "jobs": 1, **expected}.items() <= seen.items()
    assert command("bench", *arguments, "--jobs", "2").code == 1


def test_wrong_options_of_the_commands():
    for arguments in (
        ("table1", "--problems", "0"),
        ("table1", "--parameters", "7"),
        ("table2", "--battery", "much"),
        ("figure4", "--baseline-limit", "never"),
        ("conversions", "--drawn", "-1"),
    ):
        ended = command("bench", *arguments)
        assert (ended.code, ended.err.count("\n")) == (2, 1)
