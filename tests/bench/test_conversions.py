"""The study of conversions: its plans, its judgements of constraints, and its report."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import jsonschema
import pytest

import robust.bench
from robust.bench import conversions
from robust.bench.conversion_plans import delivery_order, delivery_plan, drawn_plan
from robust.bench.conversions import ConversionTask, Source, convert_and_judge, run_conversions
from robust.bench.removals import Kind, Removal, edges_of, judge_constraints
from robust.errors import InputError
from robust.execute.convert import check_plan
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus
from robust.irr.check import Answer
from robust.plan.model import TemporalConstraint
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.timed import parse_timed_plan
from robust.smt.limits import Deadline
from tests.bench.conftest import rendered
from tests.execute.plans import EPSILON, converted
from tests.execute.test_convert import DOMAIN, problem

SCHEMA = Path(robust.bench.__file__).parent / "schemas" / "bench-conversions.schema.json"


def checked(report):
    value = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    jsonschema.validate(value, json.loads(SCHEMA.read_text()))
    return value


# -- plans -------------------------------------------------------------------------------------------------------------


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


# -- the report --------------------------------------------------------------------------------------------------------


class Planner:
    """Answers with the drawn plan itself, but finds nothing for the first problem."""

    name = "stand-in"

    def __init__(self) -> None:
        self.asked = 0

    def solve(self, domain, problem, deadline):
        self.asked += 1
        if self.asked == 1:
            return PlannerAnswer("stand-in", PlannerStatus.NO_PLAN, None, 0.1, "no plan for this one")
        texts = drawn_plan(7)
        return PlannerAnswer("stand-in", PlannerStatus.SOLVED, parse_timed_plan(texts.plan), 0.1)


def test_the_study(tmp_path, monkeypatch):
    planner = Planner()
    monkeypatch.setattr(conversions, "_planner", lambda _name: planner)
    monkeypatch.setattr(conversions, "delivery_order", lambda _seed: (drawn_plan(7).domain, drawn_plan(7).problem))
    lines = []
    store = tmp_path / "store"
    options = {"drawn": 4, "delivery": 1, "planned": 1, "planner": "stand-in", "store": store}
    report = run_conversions(**options, on_result=lambda _done, _total, line: lines.append(line))
    assert report.agrees
    assert planner.asked == 2
    assert [row.task.source for row in report.rows] == [Source.DRAWN] * 4 + [Source.DELIVERY, Source.PLANNED]
    assert report.rows[5].plan == drawn_plan(7).plan
    assert all("0 of" in line and "proved" in line for line in lines)
    value = checked(report)
    assert "planned by stand-in, which may find other plans next time" in value["notes"]
    shown = rendered(report.tables())
    assert "with a removable bound" in shown
    assert "over-all condition" in shown
    again = run_conversions(**options)
    assert (again.rows, planner.asked) == (report.rows, 2)
    assert f"6 of 6 results are from {store}" in again.notes


def test_what_could_be_removed_is_reported(monkeypatch):
    convert = conversions.convert

    def with_more(*arguments, **options):
        found = convert(*arguments, **options)
        instance = found.plan.instances[0]
        return with_bound(found, ".zero", str(instance.start), Fraction(1, 1000))

    monkeypatch.setattr(conversions, "convert", with_more)
    report = run_conversions(drawn=1, delivery=0, planned=0)
    assert not report.agrees
    [text] = report.rows[0].removable
    assert text.endswith("(before or after a timed literal, not needed)")
    assert text in report.notes[0]
    checked(report)


def test_plans_that_fail_are_reported(monkeypatch):
    monkeypatch.setattr(conversions, "_planner", lambda _name: None)

    def broken(_seed):
        raise InputError("no such plan")

    monkeypatch.setattr(conversions, "drawn_plan", broken)
    report = run_conversions(drawn=1, delivery=0, planned=0)
    assert not report.agrees
    assert checked(report)["failures"] == [{"task": "drawn 0", "reason": "InputError: no such plan"}]
    rendered(report.tables())


def test_the_schedule_of_the_plan_is_checked_anew():
    task = ConversionTask(Source.DRAWN, 3, None)
    result = convert_and_judge(task)
    assert (result["allowed"], result["proved"], result["removable"]) == (True, True, [])
    texts = drawn_plan(3)
    conversion = converted(texts.domain, texts.problem, texts.plan)
    timed = parse_timed_plan(texts.plan)
    assert conversions._allowed(conversion, timed)
    later = replace(timed, steps=(replace(timed.steps[0], time=timed.steps[0].time + 1), *timed.steps[1:]))
    assert not conversions._allowed(conversion, later)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"drawn": 0, "delivery": 0, "planned": 0}, "expected at least one plan"),
        ({"drawn": -1}, "expected at least one plan"),
        ({"limit": 0.0}, "the limit is 0"),
        ({"planner": "nobody"}, "found planner 'nobody'"),
        ({"drawn": 1, "planned": 0, "jobs": 0}, "jobs is 0"),
    ],
)
def test_wrong_options(options, message):
    with pytest.raises(InputError, match=message):
        run_conversions(**options)
