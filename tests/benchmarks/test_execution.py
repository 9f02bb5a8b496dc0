"""Conversions and tables 1 and 2: judgements by brute force, reports by hand, and planners that know one plan."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

from benchmarks.engine.stats import Pairing, Proportion
from benchmarks.engine.sweep import Failure
from benchmarks.generators.plans import delivery_order, delivery_plan, drawn_plan
from benchmarks.irr import conversions, tables
from benchmarks.irr.conversions import (
    ConversionTask,
    Kind,
    Removal,
    Source,
    convert_and_judge,
    edges_of,
    is_allowed,
    judge_constraints,
)
from benchmarks.irr.tables import (
    DREEX,
    EXECUTORS,
    TABLE1,
    TABLE1_DESIGN,
    TABLE2_DESIGN,
    ExecutionRow,
    Table1Report,
    uncertain_rules,
    uncertain_specs,
)
from robust.errors import InputError
from robust.execute.convert import check_plan
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.irr.check import Answer
from robust.plan.model import TemporalConstraint
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.timed import parse_timed_plan
from robust.smt.limits import Deadline
from tests.benchmarks.conftest import checked, rendered, run
from tests.execute.plans import EPSILON, converted
from tests.execute.test_convert import DOMAIN, problem

# -- conversions: plans ------------------------------------------------------------------------------------------------


def test_drawn_plans_are_those_of_their_seed_and_valid():
    first = [drawn_plan(seed) for seed in range(12)]
    assert first == [drawn_plan(seed) for seed in range(12)]
    assert len({one.domain for one in first}) == 12
    texts = "".join(one.domain + one.problem for one in first)
    for feature in ("#t", "(or ", "(over all", "(at end", "(>= ?duration", ":action ", "(at 1", "decrease"):
        assert feature in texts
    for one in first:
        assert len(one.plan.splitlines()) > 1
        converted(one.domain, one.problem, one.plan)  # an invalid plan is an error


def test_delivery_plans_and_problems_are_those_of_their_seed():
    assert delivery_plan(3) == delivery_plan(3) != delivery_plan(4)
    assert delivery_order(3) == delivery_order(3) != delivery_order(4)
    parse_problem(delivery_order(5)[1], parse_domain(delivery_order(5)[0]))


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
    assert found[".zero - n0 >= 4001/1000" if ".zero - n0 >= 4001/1000" in found else "n0 - .zero >= 4001/1000"] == (
        Kind.LITERAL,
        Removal.NEEDED,
    )
    assert found["n2.start - n1.end >= 1/1000"] == (Kind.SEPARATION, Removal.NEEDED)
    found = judged(converted(DOMAIN, problem(), "0: (draw) [2]\n0: (heat) [10]\n11: (bathe) [5]"))
    assert found["n0.start - n0.end >= -7"] == (Kind.NUMBERS, Removal.NEEDED)


def test_what_is_implied_and_what_is_not_needed():
    conversion = converted(DOMAIN, problem(), STEPS)
    found = judged(with_bound(conversion, "n0", "n2", Fraction(1, 1000)))
    assert found["n2 - n0 >= 1/1000"] == (Kind.SEPARATION, Removal.IMPLIED)
    found = judged(with_bound(conversion, "n1.end", "n2", 3))
    assert found["n2 - n1.end >= 3"] == (Kind.PROTECTION, Removal.NEEDLESS)
    assert found["n2 - n1.end >= 0"] == (Kind.PROTECTION, Removal.IMPLIED)


def test_without_time_nothing_is_known():
    conversion = converted(DOMAIN, problem(), STEPS)
    found = judge_constraints(conversion, EPSILON, "z3", Deadline.after(0))
    assert {one.removal for one in found} == {Removal.UNKNOWN}


def test_parameters_are_not_judged():
    with pytest.raises(ValueError, match="without parameters"):
        judged(converted(DOMAIN, problem(), STEPS, "duration:read"))


def test_judgements_by_brute_force():
    """Of drawn plans: without each bound that is needed the plan is refuted, and it is proved with all of them."""
    kinds = set()
    for seed in range(25):
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
    """Answers with the drawn plan itself, but finds nothing for the first problem."""

    def __init__(self):
        self.asked = 0

    def solve(self, domain, problem, deadline):
        self.asked += 1
        if self.asked == 1:
            return PlannerAnswer("stand-in", PlannerStatus.NO_PLAN, None, 0.1, "no plan for this one")
        return PlannerAnswer("stand-in", PlannerStatus.SOLVED, parse_timed_plan(drawn_plan(7).plan), 0.1)


def test_the_study(tmp_path, monkeypatch):
    planner = Planner()
    monkeypatch.setattr(conversions, "create_planner", lambda _name: planner)
    monkeypatch.setattr(conversions, "delivery_order", lambda _seed: (drawn_plan(7).domain, drawn_plan(7).problem))
    lines = []
    store = tmp_path / "store"
    options = {"drawn": 4, "delivery": 1, "planned": 1, "planner": "stand-in", "store": store}
    report = run("conversions", **options, on_result=lambda _done, _total, line: lines.append(line))
    assert report.agrees
    assert planner.asked == 2
    assert [row.source for row in report.rows] == [Source.DRAWN] * 4 + [Source.DELIVERY, Source.PLANNED]
    assert report.rows[5].plan == drawn_plan(7).plan
    assert all("0 of" in line and "proved" in line for line in lines)
    assert "planned by stand-in, which may find other plans next time" in checked(report)["notes"]
    shown = rendered(report.tables)
    assert "with a removable bound" in shown
    assert "over-all condition" in shown
    again = run("conversions", **options)
    assert (again.rows, planner.asked) == (report.rows, 2)
    assert f"6 of 6 results are from {store}" in again.notes


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


def test_plans_that_fail_are_reported(monkeypatch):
    def broken(_seed):
        raise InputError("no such plan")

    monkeypatch.setattr(conversions, "drawn_plan", broken)
    report = run("conversions", drawn=1, delivery=0, planned=0)
    assert not report.agrees
    assert checked(report)["failures"] == [{"task": "drawn 0", "reason": "InputError: no such plan"}]
    assert "1 in all" in rendered(report.tables)


def test_the_schedule_of_the_plan_is_checked_anew():
    result = convert_and_judge(ConversionTask(Source.DRAWN, 3, None))
    assert (result.allowed, result.proved, result.removable) == (True, True, ())
    texts = drawn_plan(3)
    conversion = converted(texts.domain, texts.problem, texts.plan)
    timed = parse_timed_plan(texts.plan)
    assert is_allowed(conversion, timed)
    later = replace(timed, steps=(replace(timed.steps[0], time=timed.steps[0].time + 1), *timed.steps[1:]))
    assert not is_allowed(conversion, later)


# -- tables: the report ------------------------------------------------------------------------------------------------


def row(executor, problem, succeeded, replans=0, *, column="1 parameter", promises=0, broken=0):
    reason = "" if succeeded else "x"
    return ExecutionRow(column, executor, problem, 0, succeeded, replans, promises, broken, 0.1, reason)


def report(*rows, **fields):
    options = TABLE1.options(problems=1, executors=(DREEX, "blex:0", "blex:10"))
    facts = {"planner": "aries", "planner_s": 7.0, "drain": False, "battery": None}
    return Table1Report(TABLE1, options, facts, rows, **fields)


def test_the_papers_figures():
    for design, columns in ((TABLE1_DESIGN, 5), (TABLE2_DESIGN, 1)):
        assert len(design.columns) == columns
        assert tuple(design.paper) == EXECUTORS
        assert {len(cells) for cells in design.paper.values()} == {columns}
        for column in design.columns:
            shares = [design.paper_cell(one, column).coverage for one in EXECUTORS]
            assert max(shares) == shares[0]
            assert shares[1:] == sorted(shares[1:])
    assert TABLE1_DESIGN.paper_cell("blex:40", "3 parameters").coverage == 34.7
    assert TABLE1_DESIGN.paper_cell("blex:20", "5 parameters").replans == 1.9
    assert TABLE1_DESIGN.paper_cell("blex:0", "5 parameters").replans is None
    assert TABLE2_DESIGN.paper_cell(DREEX, "battery").coverage == 99.2


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
    assert (value["settings"]["problems"], value["settings"]["battery"]) == (1, None)
    shown = rendered(made.tables)
    assert "66.7 % [21–94] / 92.2 %" in shown
    assert "1 : 0, 1.0000" in shown
    assert "1 parameter: DREEX re-plans 0.3 times or more" in " ".join(shown.split())


def test_claims():
    good = report(row(DREEX, "a", True), row("blex:0", "a", False))
    assert good.agrees
    assert not report(row(DREEX, "a", True), row("blex:0", "a", True)).agrees
    assert not replace(good, finished=False).agrees
    assert not replace(good, failures=(Failure("case", "no"),)).agrees
    broken = report(row(DREEX, "a", True, promises=3, broken=1), row("blex:0", "a", False))
    assert not broken.agrees
    assert "broken promise: dreex, a, seed 0" in broken.notes
    assert "3 plans had to succeed" in broken.notes[1]
    assert checked(broken)["agrees"] is False
    checked(report())


# -- tables: what is uncertain -----------------------------------------------------------------------------------------


def test_the_longest_steps_are_uncertain_first():
    assert [one.subject for one in uncertain_specs(1, 2)] == ["prepare_step6", "prepare_step5"]
    assert [rule.name for rule in uncertain_rules(1, 5).rules] == [f"prepare_step{i}" for i in (6, 5, 4, 3, 2)]
    for rule in uncertain_rules(1, 2).rules:
        assert (rule.distribution, rule.numbers) == ("normal", {"deviation": 70, "minimum": 30})
    [rule] = uncertain_rules(2, 1).rules
    assert (rule.name, rule.numbers["deviation"]) == ("battery_use", Fraction(13, 2))
    assert len(uncertain_specs(2, 1)) == 12


# -- tables: runs ------------------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize(("table", "columns"), [("table1", (1, 3)), ("table2", ())])
def test_short_runs(table, columns, monkeypatch, tmp_path):
    planner = OnePlan()
    monkeypatch.setattr(tables, "create_planner", lambda _name: planner)
    lines = []
    options = {"problems": 3, "columns": columns, "planner": "one-plan", "executors": (DREEX, "blex:0", "blex:30")}
    options["store"] = tmp_path / "store"
    made = run(table, **options, on_result=lambda _done, _total, line: lines.append(line))
    assert made.complete
    assert made.failures == ()
    assert len(made.rows) == 3 * 3 * len(columns or (1,))
    assert made.broken_promises == []
    # Without another plan, BLEX(0) fails as soon as anything deviates; what DREEX accepts it also executes.
    assert not any(one.succeeded for one in made.rows if one.executor == "blex:0")
    assert any(one.promises for one in made.rows if one.executor == DREEX)
    for one in made.rows:
        assert one.succeeded == (one.reason == "")
        assert one.promises == 0 or one.executor == DREEX
    assert len(lines) == 3 * len(columns or (1,))
    assert checked(made)["settings"]["problems"] == 3
    rendered(made.tables)
    asked = planner.asked
    again = run(table, **options)
    assert again.rows == made.rows
    assert planner.asked == asked


def test_no_plan_to_begin_with(monkeypatch):
    class Nobody(OnePlan):
        def solve(self, domain, problem, deadline):
            return PlannerAnswer(self.name, PlannerStatus.TIMEOUT, None, 1.0, "too late")

    monkeypatch.setattr(tables, "create_planner", lambda _name: Nobody())
    made = run("table1", problems=1, columns=(1,), executors=(DREEX, "blex:60"))
    assert [(one.succeeded, one.reason) for one in made.rows] == [(False, "timeout: too late")] * 2
