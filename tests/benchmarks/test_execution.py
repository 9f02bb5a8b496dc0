"""Conversions and tables 1 and 2: judgements by brute force, reports by hand, and planners that know one plan."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

from benchmarks.engine.stats import Pairing, Proportion
from benchmarks.generators.plans import delivery_order, delivery_plan, drawn_plan
from benchmarks.irr import conversions, tables
from benchmarks.irr.conversions import Kind, Removal, Source, convert_and_judge, edges_of, is_allowed, judge_constraints
from benchmarks.irr.tables import (
    DREEX,
    EVERY_ACTION,
    EXECUTORS,
    SLICE,
    TABLE1,
    TABLE1_DESIGN,
    TABLE2_DESIGN,
    ExecutionRow,
    PaperCell,
    Table1Report,
    uncertain_rules,
    uncertain_specs,
)
from robust.execute.convert import check_plan
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.irr.check import Answer
from robust.plan.model import TemporalConstraint
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.timed import parse_timed_plan
from robust.smt.limits import Deadline
from robust.sweeps.sweep import TaskFailure
from tests.benchmarks.conftest import checked, rendered, run
from tests.execute.plans import EPSILON, converted
from tests.execute.test_convert import DOMAIN, problem

# -- conversions: plans ------------------------------------------------------------------------------------------------


def test_plans_are_those_of_their_seed_and_valid():
    for made in (delivery_plan, delivery_order, drawn_plan):
        assert made(3) == made(3) != made(4)
    parse_problem(delivery_order(5)[1], parse_domain(delivery_order(5)[0]))
    drawn = [drawn_plan(seed) for seed in range(12)]
    assert len({one.domain for one in drawn}) == 12
    texts = "".join(one.domain + one.problem for one in drawn)
    for feature in ("#t", "(or ", "(over all", "(at end", "(>= ?duration", ":action ", "(at 1", "decrease"):
        assert feature in texts
    for one in drawn:
        assert len(one.plan.splitlines()) > 1
        converted(one.domain, one.problem, one.plan)  # an invalid plan is an error


# -- judgements --------------------------------------------------------------------------------------------------------


def judged(conversion):
    return {str(one.edge): (one.kind, one.removal) for one in judge_constraints(conversion, EPSILON, "z3", Deadline())}


def with_bound(conversion, source, target, weight):
    """The conversion with one more lower bound."""
    points = {str(point): point for point in conversion.plan.time_points}
    extra = TemporalConstraint(points[source], points[target], Polynomial.constant(Fraction(weight)), None)
    return replace(conversion, plan=replace(conversion.plan, constraints=(*conversion.plan.constraints, extra)))


STEPS = "1: (switch-on)\n2: (read) [5]\n9: (switch-off)"


def test_what_is_needed():
    assert judged(converted(DOMAIN, problem(), STEPS)) == {
        "n1.end - n1.start >= 2": (Kind.DURATION, Removal.NEEDED),
        "n1.start - n1.end >= -9": (Kind.DURATION, Removal.NEEDED),
        "n1.start - n0 >= 0": (Kind.PROTECTION, Removal.NEEDED),
        "n2 - n1.end >= 0": (Kind.PROTECTION, Removal.NEEDED),
    }
    found = judged(converted(DOMAIN, problem("(at 4 (open))"), "6: (wait)\n7: (heat) [10]\n18: (bathe) [5]"))
    assert found["n0 - .zero >= 4001/1000"] == (Kind.LITERAL, Removal.NEEDED)
    assert found["n2.start - n1.end >= 1/1000"] == (Kind.SEPARATION, Removal.NEEDED)
    found = judged(converted(DOMAIN, problem(), "0: (draw) [2]\n0: (heat) [10]\n11: (bathe) [5]"))
    assert found["n0.start - n0.end >= -7"] == (Kind.NUMBERS, Removal.NEEDED)


def test_what_is_implied_not_needed_or_not_known():
    conversion = converted(DOMAIN, problem(), STEPS)
    found = judged(with_bound(conversion, "n0", "n2", Fraction(1, 1000)))
    assert found["n2 - n0 >= 1/1000"] == (Kind.SEPARATION, Removal.IMPLIED)
    found = judged(with_bound(conversion, "n1.end", "n2", 3))
    assert found["n2 - n1.end >= 3"] == (Kind.PROTECTION, Removal.NEEDLESS)
    assert found["n2 - n1.end >= 0"] == (Kind.PROTECTION, Removal.IMPLIED)
    late = judge_constraints(conversion, EPSILON, "z3", Deadline.after(0))
    assert {one.removal for one in late} == {Removal.UNKNOWN}
    with pytest.raises(ValueError, match="without parameters"):
        judged(converted(DOMAIN, problem(), STEPS, "duration:read"))


@pytest.mark.parametrize("seeds", [range(6), pytest.param(range(6, 60), marks=pytest.mark.slow)], ids=len)
def test_judgements_by_brute_force(seeds):
    """Of drawn plans: without each bound that is needed the plan is refuted, and it is proved with all of them."""
    kinds = set()
    for seed in seeds:
        texts = drawn_plan(seed)
        conversion = converted(texts.domain, texts.problem, texts.plan)
        edges = list(edges_of(conversion.plan))
        judgements = judge_constraints(conversion, EPSILON, "z3", Deadline())
        assert [one.edge for one in judgements] == edges
        for one in judgements[:: max(1, len(edges) // 3)]:
            rest = tuple(
                TemporalConstraint(other.source, other.target, Polynomial.constant(other.weight), None)
                for other in edges
                if other != one.edge
            )
            plan = replace(conversion.plan, constraints=rest)
            answer = check_plan(plan, EPSILON, "cvc5", Deadline()).answer
            assert (answer is Answer.PROVED) is one.removal.removable
        kinds |= {one.kind for one in judgements}
    assert {Kind.DURATION, Kind.SEPARATION, Kind.LITERAL} <= kinds


# -- conversions: the report -------------------------------------------------------------------------------------------


class Planner:
    """Answers with one plan, but from one question on, or up to it, with none."""

    name = "stand-in"

    def __init__(self, plan, knows=lambda asked, problem: True):
        self.plan, self.knows, self.asked = parse_timed_plan(plan), knows, 0

    def solve(self, domain, problem, deadline):
        self.asked += 1
        if self.knows(self.asked, problem):
            return PlannerAnswer(self.name, PlannerStatus.SOLVED, self.plan, 0.1)
        return PlannerAnswer(self.name, PlannerStatus.NO_PLAN, None, 0.1, "knows no plan")


def test_planned_plans(tmp_path, monkeypatch):
    planner = Planner(drawn_plan(7).plan, lambda asked, _: asked > 1)
    monkeypatch.setattr(conversions, "create_planner", lambda _name: planner)
    monkeypatch.setattr(conversions, "delivery_order", lambda _seed: (drawn_plan(7).domain, drawn_plan(7).problem))
    options = {"drawn": 0, "delivery": 0, "planned": 1, "planner": "stand-in", "store": tmp_path / "store"}
    report = run("conversions", **options)
    assert report.agrees
    assert [(row.source, row.plan) for row in report.rows] == [(Source.PLANNED, drawn_plan(7).plan)]
    assert planner.asked == 2
    assert "planned by stand-in, which may find other plans next time" in checked(report)["notes"]
    assert (run("conversions", **options).rows, planner.asked) == (report.rows, 2)


def test_what_could_be_removed_is_reported(monkeypatch):
    convert = conversions.convert

    def with_more(*arguments, **options):
        found = convert(*arguments, **options)
        return with_bound(found, ".zero", str(found.plan.instances[0].start), Fraction(1, 1000))

    monkeypatch.setattr(conversions, "convert", with_more)
    report = run("conversions", drawn=1, delivery=0, planned=0)
    assert not report.agrees
    [text] = report.rows[0].removable
    assert text.endswith("(before or after a timed literal, not needed)")
    assert text in report.notes[0]
    checked(report)


def test_the_schedule_of_the_plan_is_checked_anew():
    result = convert_and_judge(Source.DRAWN, 3)
    assert (result.allowed, result.proved, result.removable) == (True, True, ())
    texts = drawn_plan(3)
    conversion = converted(texts.domain, texts.problem, texts.plan)
    timed = parse_timed_plan(texts.plan)
    assert is_allowed(conversion, timed)
    later = replace(timed, steps=(replace(timed.steps[0], time=timed.steps[0].time + 1), *timed.steps[1:]))
    assert not is_allowed(conversion, later)


# -- tables: the report ------------------------------------------------------------------------------------------------


def row(executor, problem, reason="", replans=0, *, column="1 parameter", promises=0, broken=0):
    """A run that succeeded, unless there is a reason why not."""
    return ExecutionRow(column, executor, problem, 0, not reason, replans, promises, broken, 0.1, reason)


def report(*rows, **fields):
    options = TABLE1.options(problems=1, executors=(DREEX, "blex:0", "blex:10"))
    facts = {"planner": "aries", "planner_s": 7.0, "drain": False, "battery": None, "problems": 1, "runs": 1, "seed": 0}
    return Table1Report(TABLE1, options, facts, rows, **fields)


def test_the_papers_figures():
    for design, count in ((TABLE1_DESIGN, 5), (TABLE2_DESIGN, 1)):
        columns = [column for column in design.columns if column != EVERY_ACTION]
        assert len(columns) == count
        for column in columns:
            assert design.paper_cell(SLICE, column) == PaperCell(None, None)
            shares = [design.paper_cell(one, column).coverage for one in EXECUTORS if one != SLICE]
            assert max(shares) == shares[0]
            assert shares[1:] == sorted(shares[1:])
    assert TABLE1_DESIGN.paper_cell("blex:40", "3 parameters") == PaperCell(34.7, 1.0)
    assert TABLE1_DESIGN.paper_cell("blex:20", "5 parameters") == PaperCell(0.8, 1.9)
    assert TABLE1_DESIGN.paper_cell("blex:0", "5 parameters") == PaperCell(0.0, None)
    assert TABLE2_DESIGN.paper_cell(DREEX, "battery") == PaperCell(99.2, 0.1)


def test_cells_by_hand():
    made = report(
        row(DREEX, "a", replans=1),
        row(DREEX, "b"),
        row(DREEX, "c", "x", 4),
        row("blex:10", "a", "x"),
        row("blex:10", "b", replans=2),
        row("blex:10", "c", "x"),
        row("blex:10", "d"),  # not in a pair
    )
    mine, other = made.cell(DREEX, "1 parameter"), made.cell("blex:10", "1 parameter")
    assert (mine.coverage, mine.replans.value, mine.against) == (Proportion(2, 3), 0.5, None)
    assert (other.coverage, other.replans.value) == (Proportion(2, 4), 1)
    assert other.against == Pairing(first=1, second=0, both=1, neither=1)
    assert made.cell("blex:0", "1 parameter") is made.cell(DREEX, "2 parameters") is None
    assert (made.is_above("1 parameter"), made.is_above("2 parameters")) == (True, None)
    assert (made.has_few_replans("1 parameter"), made.agrees) == (False, False)
    cell = checked(made)["columns"][0]["cells"]["blex:10"]
    assert (cell["p_value"], cell["paper_coverage"]) == (1, 24.5)
    shown = " ".join(rendered(made.tables).split())
    for text in ("66.7 % [21–94] / 92.2 %", "1 : 0, 1.0000", "1 parameter: DREEX re-plans 0.3 times or more"):
        assert text in shown


def test_slicing_is_compared_with_dreex_case_by_case():
    made = report(
        row(DREEX, "a", replans=1),
        row(DREEX, "b", "x", 2),
        replace(row(SLICE, "a"), looks=3),
        replace(row(SLICE, "b"), looks=4, late=1, nothing=1),
    )
    assert "1 parameter: DREEX is not above every other" not in made.notes
    assert (
        "Slicing takes 0 re-plans where DREEX takes 3, and succeeds in 2 runs where DREEX does in 1, of 2 each. It "
        "looked at what is left 7 times; the time was over in 1 of these, and nothing was left in 1."
    ) in made.conclusions()


def test_claims():
    mine, other = row(DREEX, "a"), row("blex:0", "a", "x")
    good = report(mine, other)
    assert good.agrees
    for wrong in (
        report(mine, row("blex:0", "a")),
        replace(good, finished=False),
        replace(good, failures=(TaskFailure("case", "no"),)),
        report(replace(mine, promises=3, broken=1), other),
    ):
        assert not wrong.agrees
        checked(wrong)
    assert "broken promise: dreex, a, seed 0" in wrong.notes
    assert "3 plans had to succeed" in wrong.notes[2]
    checked(report())


# -- tables: what is uncertain -----------------------------------------------------------------------------------------


def test_the_longest_steps_are_uncertain_first():
    assert [one.subject for one in uncertain_specs(1, 2)] == ["prepare_step6", "prepare_step5"]
    assert [rule.name for rule in uncertain_rules(1, 5).rules] == [f"prepare_step{i}" for i in (6, 5, 4, 3, 2)]
    for rule in uncertain_rules(1, 2).rules:
        assert (rule.distribution, rule.numbers) == ("normal", {"deviation": 70, "minimum": 30})
    every = uncertain_rules(1, 6).rules
    assert {rule.name for rule in every} == {one.subject for one in uncertain_specs(1, 6)}
    assert (len(every), every[0].name, every[0].relative) == (12, "move", True)
    [rule] = uncertain_rules(2, 1).rules
    assert (rule.name, rule.numbers["deviation"]) == ("battery_use", Fraction(13, 2))
    assert len(uncertain_specs(2, 1)) == 12


# -- tables: runs ------------------------------------------------------------------------------------------------------


STEPS_TO_THE_NEARER_ORDER = (
    ("move robot1 dock1 shelf", 20),
    ("collect robot1 spindle1_1 shelf", 15),
    ("move robot1 shelf base_station", 15),
    *((f"prepare_step{i} robot1 spindle1_1 base_station", 110 + 10 * i) for i in range(6, 0, -1)),
    ("assemble robot1 spindle1_1 base_station level0", 40),
    ("move robot1 base_station ring_station", 35),
    ("mount robot1 spindle1_1 ring_station level0 level1", 35),
    ("move robot1 ring_station gate1", 60),
    ("deliver robot1 spindle1_1 order1 gate1 level1", 24),
)


def first_plan():
    """As early as it goes; the preparations run at once, but start apart, because all take from the battery."""
    lines, time = [], Fraction(0)
    for action, duration in STEPS_TO_THE_NEARER_ORDER:
        lines.append(f"{time}: ({action}) [{duration}]")
        time += Fraction(1, 1000)
        if not action.startswith("prepare"):
            time += duration
        elif action.startswith("prepare_step1"):
            time += 170
    return "\n".join(lines)


def at_the_dock(_asked, problem):
    return any(str(atom) == "(robot_at robot1 dock1)" for atom in problem.atoms)


@pytest.mark.parametrize(("table", "columns"), [("table1", (1, 3)), ("table2", ())])
def test_short_runs(table, columns, monkeypatch, tmp_path):
    planner = Planner(first_plan(), at_the_dock)
    monkeypatch.setattr(tables, "create_planner", lambda _name: planner)
    options = {"problems": 3, "columns": columns, "planner": "stand-in", "executors": (DREEX, "blex:0", "blex:30")}
    options["store"] = tmp_path / "store"
    lines = []
    made = run(table, **options, on_result=lambda *progress: lines.append(progress))
    assert (made.complete, made.failures, made.broken_promises) == (True, (), [])
    assert len(made.rows) == 3 * len(lines) == 3 * 3 * len(columns or (1,))
    # Without another plan, BLEX(0) fails as soon as anything deviates; what DREEX accepts it also executes.
    assert not any(one.succeeded for one in made.rows if one.executor == "blex:0")
    assert {one.executor for one in made.rows if one.promises} == {DREEX}
    assert all(one.succeeded == (one.reason == "") for one in made.rows)
    assert checked(made)["settings"]["problems"] == 3
    asked = planner.asked
    assert (run(table, **options).rows, planner.asked) == (made.rows, asked)


def test_no_plan_to_begin_with(monkeypatch):
    monkeypatch.setattr(tables, "create_planner", lambda _name: Planner(first_plan(), lambda *_: False))
    made = run("table1", problems=1, columns=(1,), executors=(DREEX, "blex:60"))
    assert [(one.succeeded, one.reason) for one in made.rows] == [(False, "no plan: knows no plan")] * 2
