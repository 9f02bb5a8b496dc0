"""Conversions and tables 1 and 2: judgements by brute force, reports by hand, and planners that know one plan."""

from dataclasses import replace
from fractions import Fraction

import pytest

from benchmarks.engine.stats import Pairing, Proportion
from benchmarks.generators.plans import delivery_order, delivery_plan, drawn_plan
from benchmarks.irr import conversions, monitored, tables
from benchmarks.irr.conversions import Kind, Removal, Source
from benchmarks.irr.tables import DREEX, EVERY_ACTION, EXECUTORS, SLICE, TABLE1, ExecutionRow, PaperCell, Table1Report
from robust.execute.causal import check_plan
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.execute.replan import first_plan as first_prepared
from robust.irr.check import Answer
from robust.plan.model import TemporalConstraint
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.timed import parse_timed_plan
from robust.smt.limits import NEVER, Deadline
from robust.sweeps.sweep import TaskFailure
from tests.benchmarks.conftest import checked, rendered, run
from tests.execute.plans import EPSILON, converted
from tests.execute.test_convert import DOMAIN, problem
from tests.sampling import often

STEPS = "1: (switch-on)\n2: (read) [5]\n9: (switch-off)"


def test_plans_are_those_of_their_seed_and_valid():
    for draw in (delivery_plan, delivery_order, drawn_plan):
        assert draw(3) == draw(3) != draw(4)
    parse_problem(delivery_order(5)[1], parse_domain(delivery_order(5)[0]))
    plans = [drawn_plan(seed) for seed in range(often(8, 12))]
    assert len({one.domain for one in plans}) == len(plans)
    texts = "".join(one.domain + one.problem for one in plans)
    features = ("#t", "(or ", "(over all", "(at end", "(>= ?duration", ":action ", "(at 1", "decrease")
    assert [feature for feature in features if feature not in texts] == []
    for one in plans:
        assert len(one.plan.splitlines()) > 1
        converted(one.domain, one.problem, one.plan)  # an invalid plan is an error


def judgements(conversion, deadline=NEVER):
    return conversions.judge_constraints(conversion, EPSILON, "z3", deadline)


def judged(*texts):
    return {str(one.edge): (one.kind, one.removal) for one in judgements(converted(DOMAIN, *texts))}


def with_bounds(conversion, *edges, keep=True):
    """The conversion with more lower bounds, or with these only."""
    points = {str(point): point for point in conversion.plan.time_points}
    bounds = tuple(
        TemporalConstraint(points[source], points[target], Polynomial.constant(Fraction(weight)), None)
        for source, target, weight in edges
    )
    constraints = (*conversion.plan.constraints, *bounds) if keep else bounds
    return replace(conversion, plan=replace(conversion.plan, constraints=constraints))


def test_what_is_needed():
    assert judged(problem(), STEPS) == {
        "n1.end - n1.start >= 2": (Kind.DURATION, Removal.NEEDED),
        "n1.start - n1.end >= -9": (Kind.DURATION, Removal.NEEDED),
        "n1.start - n0 >= 0": (Kind.PROTECTION, Removal.NEEDED),
        "n2 - n1.end >= 0": (Kind.PROTECTION, Removal.NEEDED),
    }
    heated = judged(problem("(at 4 (open))"), "6: (wait)\n7: (heat) [10]\n18: (bathe) [5]")
    assert heated["n0 - .zero >= 4001/1000"] == (Kind.LITERAL, Removal.NEEDED)
    assert heated["n2.start - n1.end >= 1/1000"] == (Kind.SEPARATION, Removal.NEEDED)
    drawn = judged(problem(), "0: (draw) [2]\n0: (heat) [10]\n11: (bathe) [5]")
    assert drawn["n0.start - n0.end >= -7"] == (Kind.NUMBERS, Removal.NEEDED)


def test_what_is_implied_not_needed_or_not_known():
    conversion = converted(DOMAIN, problem(), STEPS)
    for edge, expected in (
        (("n0", "n2", Fraction(1, 1000)), {"n2 - n0 >= 1/1000": (Kind.SEPARATION, Removal.IMPLIED)}),
        (("n1.end", "n2", 3), {"n2 - n1.end >= 3": (Kind.PROTECTION, Removal.NEEDLESS),
                               "n2 - n1.end >= 0": (Kind.PROTECTION, Removal.IMPLIED)}),
    ):  # fmt: skip
        more = {str(one.edge): (one.kind, one.removal) for one in judgements(with_bounds(conversion, edge))}
        assert expected.items() <= more.items()
    assert {one.removal for one in judgements(conversion, Deadline.after(0))} == {Removal.UNKNOWN}
    with pytest.raises(ValueError, match="without parameters"):
        judged(problem(), STEPS, "duration:read")


@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(2, 60), marks=pytest.mark.slow)], ids=len)
def test_judgements_by_brute_force(seeds):
    """Of drawn plans: without each bound that is needed the plan is refuted, and it is proved with all of them."""
    kinds = set()
    for seed in seeds:
        conversion = converted(*drawn_plan(seed)[:3])
        edges = list(conversions.edges_of(conversion.plan))
        verdicts = judgements(conversion)
        assert [one.edge for one in verdicts] == edges
        for one in verdicts[:: max(1, len(edges) // 3)]:
            others = [(str(edge.source), str(edge.target), edge.weight) for edge in edges if edge != one.edge]
            plan = with_bounds(conversion, *others, keep=False).plan
            answer = check_plan(plan, EPSILON, "cvc5", NEVER).answer
            assert (answer is Answer.PROVED) is one.removal.removable
        kinds |= {one.kind for one in verdicts}
    assert {Kind.DURATION, Kind.SEPARATION, Kind.LITERAL} <= kinds


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
    assert (report.agrees, planner.asked) == (True, 2)
    assert [(row.source, row.plan) for row in report.rows] == [(Source.PLANNED, drawn_plan(7).plan)]
    assert "planned by stand-in, which may find other plans next time" in checked(report)["notes"]
    assert (run("conversions", **options).rows, planner.asked) == (report.rows, 2)


def test_what_could_be_removed_is_reported(monkeypatch):
    convert = conversions.convert

    def with_more(*arguments, **options):
        found = convert(*arguments, **options)
        return with_bounds(found, (".zero", str(found.plan.instances[0].start), Fraction(1, 1000)))

    monkeypatch.setattr(conversions, "convert", with_more)
    report = run("conversions", drawn=1, delivery=0, planned=0)
    [text] = report.rows[0].removable
    assert text.endswith("(before or after a timed literal, not needed)")
    assert text in checked(report)["notes"][0]
    assert not report.agrees


def test_the_schedule_of_the_plan_is_checked_anew():
    result = conversions.convert_and_judge(Source.DRAWN, 3)
    assert (result.allowed, result.proved, result.removable) == (True, True, ())
    conversion, timed = converted(*drawn_plan(3)[:3]), parse_timed_plan(drawn_plan(3).plan)
    assert conversions.is_allowed(conversion, timed)
    first, *rest = timed.steps
    assert not conversions.is_allowed(conversion, replace(timed, steps=(replace(first, time=first.time + 1), *rest)))


def row(executor, problem, reason="", replans=0, *, column="1 parameter", promises=0, broken=0):
    """A run that succeeded, unless there is a reason why not."""
    return ExecutionRow(column, executor, problem, 0, not reason, replans, promises, broken, 0.1, reason)


def report(*rows, **fields):
    options = TABLE1.options(problems=1, executors=(DREEX, "blex:0", "blex:10"))
    facts = {"planner": "aries", "planner_s": 7.0, "drain": False, "battery": None, "runs": 1, "seed": 0}
    facts["problems"] = tables.ENOUGH
    return Table1Report(TABLE1, options, facts, rows, **fields)


def test_the_papers_figures():
    for design, count in ((tables.TABLE1_DESIGN, 5), (tables.TABLE2_DESIGN, 1)):
        columns = [column for column in design.columns if column != EVERY_ACTION]
        assert len(columns) == count
        for column in columns:
            assert design.paper_cell(SLICE, column) == PaperCell(None, None)
            first, *shares = [design.paper_cell(one, column).coverage for one in EXECUTORS if one != SLICE]
            assert shares == sorted(shares)
            assert first > shares[-1]
    assert tables.TABLE1_DESIGN.paper_cell("blex:40", "3 parameters") == PaperCell(34.7, 1.0)
    assert tables.TABLE1_DESIGN.paper_cell("blex:0", "5 parameters") == PaperCell(0.0, None)
    assert tables.TABLE2_DESIGN.paper_cell(DREEX, "battery") == PaperCell(99.2, 0.1)


def test_cells_by_hand():
    runs = report(
        row(DREEX, "a", replans=1),
        row(DREEX, "b"),
        row(DREEX, "c", "x", 4),
        row("blex:10", "a", "x"),
        row("blex:10", "b", replans=2),
        row("blex:10", "c", "x"),
        row("blex:10", "d"),  # not in a pair
    )
    mine, other = runs.cell(DREEX, "1 parameter"), runs.cell("blex:10", "1 parameter")
    assert (mine.coverage, mine.replans.value, mine.against) == (Proportion(2, 3), 0.5, None)
    assert (other.coverage, other.replans.value, other.against) == (Proportion(2, 4), 1, Pairing(1, 0, 1, 1))
    assert runs.cell("blex:0", "1 parameter") is runs.cell(DREEX, "2 parameters") is None
    assert (runs.is_above("1 parameter"), runs.is_above("2 parameters")) == (True, None)
    assert (runs.has_few_replans("1 parameter"), runs.agrees) == (False, False)
    cell = checked(runs)["columns"][0]["cells"]["blex:10"]
    assert (cell["p_value"], cell["paper_coverage"]) == (1, 24.5)
    shown = " ".join(rendered(runs.tables).split())
    for text in ("66.7 % [21–94] / 92.2 %", "1 : 0, 1.0000", "1 parameter: DREEX re-plans 0.3 times or more"):
        assert text in shown


def test_slicing_is_compared_with_dreex_case_by_case():
    sliced = (replace(row(SLICE, "a"), looks=3), replace(row(SLICE, "b"), looks=4, late=1, nothing=1))
    runs = report(row(DREEX, "a", replans=1), row(DREEX, "b", "x", 2), *sliced)
    assert "1 parameter: DREEX is not above every other" not in runs.notes
    assert (
        "Slicing takes 0 re-plans where DREEX takes 3, and succeeds in 2 runs where DREEX does in 1, of 2 each. It "
        "looked at what is left 7 times; the time was over in 1 of these, and nothing was left in 1."
    ) in runs.conclusions()


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
    few = replace(wrong, rows=(mine, row("blex:0", "a")), facts={**wrong.facts, "problems": 1})
    assert few.agrees
    assert "fewer than 20 worlds: what the paper claims is not judged by them" in few.notes
    assert "broken promise: dreex, a, seed 0" in wrong.notes
    assert "3 plans had to succeed" in wrong.notes[2]
    checked(report())


def test_the_longest_steps_are_uncertain_first():
    assert [one.subject for one in tables.uncertain_specs(1, 2)] == ["prepare_step6", "prepare_step5"]
    five = tables.uncertain_rules(1, 5).rules
    assert [rule.name for rule in five] == [f"prepare_step{i}" for i in (6, 5, 4, 3, 2)]
    assert {
        (rule.form.kind, *((key, amount.value) for key, (amount,) in rule.form.amounts.items())) for rule in five
    } == {("normal", ("deviation", 70), ("minimum", 30))}
    every = tables.uncertain_rules(1, 6).rules
    assert {rule.name for rule in every} == {one.subject for one in tables.uncertain_specs(1, 6)}
    assert (len(every), every[0].name) == (12, "move")
    assert all(amount.relative for (amount,) in every[0].form.amounts.values())
    [rule] = tables.uncertain_rules(2, 1).rules
    assert (rule.name, rule.form.amounts["deviation"][0].value) == ("battery_use", Fraction(13, 2))
    assert len(tables.uncertain_specs(2, 1)) == 12


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
        last = action.startswith("prepare_step1")
        time += Fraction(1, 1000) + (170 if last else 0 if action.startswith("prepare") else duration)
    return "\n".join(lines)


@pytest.mark.parametrize(("table", "columns"), [("table1", (1, 3)), ("table2", ())])
def test_short_runs(table, columns, monkeypatch, tmp_path):
    planner = Planner(first_plan(), lambda _, problem: "(robot_at robot1 dock1)" in map(str, problem.atoms))
    monkeypatch.setattr(tables, "create_planner", lambda _name: planner)
    options = {"problems": 3, "columns": columns, "planner": "stand-in", "executors": (DREEX, "blex:0", "blex:30")}
    options["store"] = tmp_path / "store"
    lines = []
    runs = run(table, **options, on_result=lambda *progress: lines.append(progress))
    assert (runs.complete, runs.failures, runs.broken_promises) == (True, (), [])
    assert len(runs.rows) == 3 * len(lines) == 3 * 3 * len(columns or (1,))
    # Without another plan, BLEX(0) fails as soon as anything deviates; what DREEX accepts it also executes.
    assert not any(one.succeeded for one in runs.rows if one.executor == "blex:0")
    assert {one.executor for one in runs.rows if one.promises} == {DREEX}
    assert all(one.succeeded == (one.reason == "") for one in runs.rows)
    assert checked(runs)["settings"]["problems"] == 3
    asked = planner.asked
    assert (run(table, **options).rows, planner.asked) == (runs.rows, asked)


def test_no_plan_to_begin_with(monkeypatch):
    monkeypatch.setattr(tables, "create_planner", lambda _name: Planner(first_plan(), lambda *_: False))
    runs = run("table1", problems=1, columns=(1,), executors=(DREEX, "blex:60"))
    assert [(one.succeeded, one.reason) for one in runs.rows] == [(False, "no plan: knows no plan")] * 2


def test_a_monitor_follows_the_worlds_of_table_2(monkeypatch, tmp_path):
    planner = Planner(first_plan(), lambda _, problem: "(robot_at robot1 dock1)" in map(str, problem.atoms))
    monkeypatch.setattr(monitored, "create_planner", lambda _name: planner)
    plenty, _ = monitored.missions(0, Fraction(520), 7)
    followed = monitored.follow(plenty, "0/0", first_prepared(plenty))
    assert (followed.fault, followed.replans) == ("", 0)
    assert len(followed.seconds) > 2 * len(STEPS_TO_THE_NEARER_ORDER)
    scarce, _ = monitored.missions(0, Fraction(300), 7)
    prepared = first_prepared(scarce)
    faults = {monitored.follow(scarce, f"0/{seed}", prepared).fault for seed in (1, 2)}
    assert "" in faults, "nature takes less than planned"
    assert any("battery" in fault and fault.endswith("knows no plan") for fault in faults), "or more, and it is noticed"
    options = {"problems": 1, "store": tmp_path / "store"}
    report, asked = run("monitored", **options), planner.asked
    assert (report.agrees, report.failures, [row.fault for row in report.rows]) == (True, (), [""])
    assert "The monitor succeeds in 1 of 1 runs, DREEX in 1." in " ".join(rendered(report.tables).split())
    assert report.experiment.read(checked(report)).rows == report.rows
    assert (run("monitored", **options).rows, planner.asked) == (report.rows, asked)
    (row,) = report.rows
    failed = replace(report, rows=(replace(row, fault="gave up after 3 re-plans"),))
    assert not failed.agrees
    assert replace(report, rows=(replace(row, fault="no plan", dreex_fault="no plan", answers_s=()),)).agrees
    monkeypatch.setattr(monitored, "create_planner", lambda _name: Planner(first_plan(), lambda *_: False))
    (row,) = run("monitored", problems=1).rows
    assert (row.fault, row.dreex_fault, row.answers_s) == (*("stand-in: no plan: knows no plan",) * 2, ())
