"""What ends each side of a box, and what to type for room: known ones, and on drawn plans held against the checker."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import seed as hypothesis_seed

from robust.api import check, envelope
from robust.errors import InputError
from robust.irr.check import Answer
from robust.irr.search import EnvelopeResult
from robust.irr.stops import APPROACHED, CUT_SHORT, NOT_EXAMINED, Stop
from robust.plan.load import assemble, load_plan
from robust.plan.model import ParametrizedPlan
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn
from robust.qe.box import Box, Side
from robust.searching import Status
from robust.smt.limits import OutOfTimeError
from tests.irr.building import EXAMPLES, fail_at_query, loose, parameter, parametric, shipped, timed
from tests.plan.building import drawn
from tests.sampling import Network

BETA = Fraction(1, 2)
LOWER, UPPER = Side.LOWER, Side.UPPER


def told(result: EnvelopeResult) -> dict[str, str]:
    return {f"{name} {'≤' if side is UPPER else '≥'}": str(stop) for (name, side), stop in result.stops.items()}


# -- known sides -------------------------------------------------------------------------------------------------------

CRATER = "sample_2 take-sample: over all (lit crater)"
RIDGE = "sample_1 take-sample: over all (lit ridge)"
CHARGE = "drive_3 drive: over all (>= (charge scout) (reserve scout))"
NIGHT = "drive_3 drive: over all (daylight)"


@pytest.mark.parametrize(
    ("method", "specs", "ends"),
    [
        ("widen", (), [(25, CRATER), (36, CHARGE), (35, CRATER), (46, CHARGE)]),
        ("irr", (), [(30, CRATER), (45, NIGHT), (30, CRATER), (40, NIGHT)]),
        ("optimal", (), [(20, RIDGE), (45, NIGHT), (40, CRATER), (40, NIGHT)]),
        (
            "widen",
            ["to_ridge,lb=27.5"],
            [(27.5, "declared bound: lb 27.5"), (36, CHARGE), (32.5, CRATER), (46, CHARGE)],
        ),
        (
            "irr",
            ["to_ridge,ub=31"],
            [(20.625, RIDGE), (31, "declared bound: ub 31"), (39.375, CRATER), (48.125, CHARGE)],
        ),
    ],
)
def test_known_sides(method, specs, ends) -> None:
    result = envelope(shipped("two_sample_navigation", *specs), method=method)
    found = [
        (result.box[one.name].end(side), str(result.stops[one.name, side]))
        for one in result.parameters
        for side in (LOWER, UPPER)
    ]
    assert found == ends
    assert result.advice == ()


@pytest.mark.parametrize("method", ["widen", "irr", "optimal"])
@pytest.mark.parametrize("encoding", ["relational", "positions"])
def test_all_statements_of_the_network_are_named(method, encoding) -> None:
    """i lasts at least 1 from k on, and ends by k + 2 at the latest: only k ≥ 0 is demanded, by the network."""
    result = envelope(loose(3), method=method, encoding=encoding)
    ((face, stop),) = result.stops.items()
    assert face == ("k", LOWER)
    assert told(result) == {"k ≥": f"no schedule: {'; '.join(stop.statements)}"}
    assert any("[k, inf]" in one or "i.start ≥ 0" in one for one in stop.statements)


def test_unbounded_sides_have_no_end() -> None:
    result = envelope(timed(parameter("k", 2)))
    assert told(result) == {"k ≥": "i act: non-negative duration"}
    assert result.box["k"].upper is None


def test_of_many_statements_the_first_and_the_last_are_shown() -> None:
    assert Stop("x").short == "x"
    few = Stop("no schedule", ("a", "b", "c", "d", "e"))
    assert few.short == str(few) == "no schedule: a; b; c; d; e"
    many = Stop("no schedule", ("a", "b", "c", "d", "e", "f"))
    assert many.short == "no schedule: a; 4 more of the network (--json lists them); f"


# -- searches that end early -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["widen", "irr"])
def test_a_search_that_is_cut_short_says_so(monkeypatch, method) -> None:
    plan = shipped("two_sample_navigation")
    fail_at_query(monkeypatch, 30, "time")
    result = envelope(plan, method=method)
    assert result.status is Status.TIMEOUT
    assert result.verified
    assert len(result.stops) == 4
    assert str(CUT_SHORT) in told(result).values()
    assert str(NOT_EXAMINED) not in told(result).values()


def test_nothing_is_said_of_a_box_that_is_not_known_to_be_inside(monkeypatch) -> None:
    plan = shipped("two_sample_navigation")
    fail_at_query(monkeypatch, 1, "time")
    result = envelope(plan)
    assert (result.verified, result.stops, result.advice) == (False, {}, ())


@pytest.mark.parametrize("error", ["time", KeyboardInterrupt])
def test_a_complete_box_stays_complete_if_its_sides_are_not_examined(monkeypatch, error) -> None:
    """The optimal box is known, but for one of its sides a query is needed that does not come back."""
    plan = shipped("two_sample_navigation")
    complete = envelope(plan, method="optimal")
    asked = []

    def failing(self, box, *_):
        asked.append(box)
        if error == "time":
            raise OutOfTimeError
        raise error

    monkeypatch.setattr("robust.irr.widen.DiscoveredBadSet.ended_by", failing)
    result = envelope(plan, method="optimal")
    assert (result.status, result.box, len(asked)) == (Status.COMPLETE, complete.box, 1)
    assert set(result.stops.values()) == {NOT_EXAMINED}


def test_a_query_finds_what_no_known_polyhedron_says(monkeypatch) -> None:
    plan = shipped("two_sample_navigation")
    complete = envelope(plan)
    monkeypatch.setattr("robust.irr.widen.touching", lambda *_: iter(()))
    result = envelope(plan)
    assert result.stops == complete.stops


# -- drawn plans -------------------------------------------------------------------------------------------------------


def corners(box: Box) -> Iterator[dict[str, Fraction]]:
    sides = ([one.lower, one.upper] for one in box.intervals.values())
    for values in product(*([end for end in ends if end is not None] or [Fraction(0)] for ends in sides)):
        yield dict(zip(box.intervals, values, strict=True))


def assert_contradictory(plan: ParametrizedPlan, stop: Stop, box: Box) -> None:
    """The statements are the plan's, and alone leave no schedule somewhere in the box."""
    said = [one for one in plan.constraints if str(one) in stop.statements]
    literals = [one for one in plan.timed_literals if f"timed initial literal {one.point}" in stop.statements]
    default = {f"{point} ≥ 0" for point in plan.time_points}
    bounds = {f"parameter {one.name} lb {one.lower}" for one in plan.parameters}
    bounds |= {f"parameter {one.name} ub {one.upper}" for one in plan.parameters}
    known = {*map(str, said), *(f"timed initial literal {one.point}" for one in literals), *default, *bounds}
    assert set(stop.statements) <= known, stop
    reduced = replace(plan, constraints=tuple(said), timed_literals=tuple(literals), goal=())
    assert any(not Network(reduced, corner).consistent for corner in corners(box)), (str(stop), box)


def judge(plan: ParametrizedPlan, method: str) -> Iterator[str]:
    """What each side of a complete box ends at, confirmed by the checker a little beyond it."""
    try:
        result = envelope(plan, method=method, beta=BETA if method == "irr" else None, timeout=20)
    except InputError:
        return
    if result.status is not Status.COMPLETE:
        return
    finite = {(name, side) for name, one in result.box.intervals.items() for side in Side if one.end(side) is not None}
    assert set(result.stops) == finite
    for (name, side), stop in result.stops.items():
        end = result.box[name].end(side)
        assert end is not None
        if stop.name.startswith("declared bound"):
            (declared,) = (one for one in plan.parameters if one.name == name)
            assert end == (declared.upper if side is UPPER else declared.lower)
            yield "declared"
            continue
        if stop == APPROACHED:
            assert method == "optimal"
            yield "approached"
            continue
        moved = result.box.moved((name, side), end + side.sign * (BETA if method == "irr" else Fraction(1, 1000)))
        found = check(plan, at=moved.intervals, every=True)
        assert found.answer is Answer.REFUTED, stop
        if stop.statements:
            assert_contradictory(plan, stop, moved)
            yield "network"
        elif found.reason is None:
            broken = [one for one, verdict in found.obligations.items() if verdict is Answer.REFUTED]
            assert stop.every == tuple(one for one in broken if one in stop.every), stop
            if method != "irr":
                near = result.box.moved((name, side), end + side.sign * Fraction(1, 10**9))
                verdicts = check(plan, at=near.intervals, every=True).obligations
                assert stop.every == tuple(one for one, verdict in verdicts.items() if verdict is Answer.REFUTED), stop
            yield "several" if stop.also else "obligation"


@pytest.mark.parametrize("method", ["widen", "irr", "optimal"])
def test_what_ends_a_side_breaks_just_beyond(method) -> None:
    outcomes: Counter[str] = Counter()

    @settings(drawn(15), derandomize=True)
    @given(parametric())
    def run(plan) -> None:
        outcomes.update(judge(plan, method))

    run()
    assert outcomes["obligation"] > 3, outcomes


# -- durations that plan and domain both fix ---------------------------------------------------------------------------

DOMAIN = """(define (domain trips) (:types place) (:constants home - place)
 (:predicates (at ?p - place) (seen ?p - place)) (:functions (way) (rest))
 (:durative-action move :parameters (?p - place) :duration (= ?duration 5) :effect (at end (at ?p)))
 (:durative-action pause :parameters () :duration (and (>= ?duration (rest)) (<= ?duration (rest)))
  :effect (at end (at home)))
 (:durative-action look :parameters (?p - place) :duration (= ?duration (way)) :condition (over all (at ?p))
  :effect (at end (seen ?p))))"""
PROBLEM = """(define (problem trip) (:domain trips) (:objects a b - place)
 (:init (= (way) 3) (= (rest) 2) (at home) (at 20 (not (at home)))) (:goal (at a)))"""
STEPS = """durative-action instance m1 : (move a); durative-action instance m2 : (move b);
durative-action instance p : (pause); durative-action instance look : (look home);
c: m1.start - .zero in [0, 0]; c: m2.start - .zero in [0, 0]; c: p.start - .zero in [0, 0];
c: look.start - .zero in [1, 1];
"""
FIXED = STEPS + "c: m1.end - m1.start in [5, 5]; c: m2.end - m2.start in [5, 5]; c: p.end - p.start in [2, 2];"
LOOK = "c: look.end - look.start in [3, 3];"


def trips(plan: str, *specs: str) -> ParametrizedPlan:
    domain = parse_domain(DOMAIN)
    return assemble(domain, parse_problem(PROBLEM, domain), parse_stn(plan), parse_specs(specs))


def widths(result: EnvelopeResult) -> dict[str, bool]:
    """Whether each parameter has room."""
    return {name: one.width != 0 for name, one in result.box.intervals.items()}


def test_a_duration_as_a_parameter_has_room_whatever_the_domain_says() -> None:
    result = envelope(trips(FIXED + LOOK, "duration:move", "duration:p", "duration:look"))
    assert widths(result) == dict.fromkeys(["dur_m1", "dur_m2", "dur_p", "dur_look"], True)
    assert result.advice == ()


@pytest.mark.parametrize("method", ["widen", "irr", "optimal"])
@pytest.mark.parametrize(
    ("declared", "constraints", "stuck", "options"),
    [
        ("u", "[u, u] [5, 5] [2, 2] [3, 3]", ["u"], ["duration:m1"]),
        ("u v", "[u, u] [v, v] [2, 2] [3, 3]", ["u", "v"], ["duration:move"]),
        ("u w x", "[u, u] [5, 5] [w, w] [x, x]", ["u", "w", "x"], ["duration:m1", "duration:p", "duration:look"]),
        ("u", "[u, u] [u, u] [2, 2] [3, 3]", ["u"], ["duration:move"]),
    ],
)
def test_what_is_to_be_typed_gives_room(method, declared, constraints, stuck, options) -> None:
    """Parameters of the plan that the domain's durations hold at one value; `look` is an instance and an action."""
    nominal = {"u": 5, "v": 5, "w": 2, "x": 3}
    parameters = "".join(f"parameter {name} default {nominal[name]};" for name in declared.split())
    intervals = constraints.replace("] [", "]|[").split("|")
    steps = zip(("m1", "m2", "p", "look"), intervals, strict=True)
    plan = parameters + STEPS + "".join(f"c: {step}.end - {step}.start in {one};" for step, one in steps)
    result = envelope(trips(plan), method=method)
    assert not any(widths(result).values())
    (one,) = result.advice
    assert (list(one.parameters), list(one.options)) == (stuck, options)
    assert "the domain still demands (" in one.reason
    assert str(one).endswith(" ".join(f"--parameter {option}" for option in options))
    typed = envelope(trips(plan, *one.options), method=method)
    assert all(widths(typed).values())
    assert typed.advice == ()


def test_a_fluent_that_is_a_duration_has_no_room_where_the_plan_fixes_the_duration() -> None:
    result = envelope(trips(FIXED + LOOK, "fluent:(way)", "fluent:(rest)"))
    assert widths(result) == {"way": False, "rest": False}
    (one,) = result.advice
    assert one.parameters == ("way", "rest")
    assert one.options == ("duration:p", "duration:look")
    assert "the plan fixes durations that follow from them in the domain" in one.reason
    assert envelope(trips(FIXED + LOOK, "fluent:(way)", *one.options)).advice == ()


def test_a_nominal_value_that_the_domain_excludes_says_what_to_type() -> None:
    plan = "parameter u default 6;" + STEPS + FIXED.removeprefix(STEPS).replace("[5, 5]", "[u, u]", 1) + LOOK
    result = envelope(trips(plan))
    assert (result.status, result.reason) == (Status.INVALID, "m1 move: duration (= ?duration 5)")
    assert [one.options for one in result.advice] == [("duration:m1",)]
    assert envelope(trips(plan, "duration:m1")).status is Status.COMPLETE


def test_the_shipped_delivery_says_what_to_type() -> None:
    files = [EXAMPLES / "delivery" / name for name in ("domain.pddl", "problem.pddl", "plan.stn")]
    result = envelope(load_plan(*files))
    (one,) = result.advice
    assert not any(widths(result).values())
    assert all(widths(envelope(load_plan(*files, parameters=one.options))).values())


# -- whatever was asked before -----------------------------------------------------------------------------------------

ASKED = """
import sys
from random import Random
from robust.api import check, envelope
from robust.searching import Status
from tests.irr.test_stops import drawn_plans

order = int(sys.argv[1])
plans = drawn_plans(int(sys.argv[2]), int(sys.argv[3]))
questions = [(number, method) for number in range(len(plans)) for method in ("widen", "irr", "optimal")]
Random(order).shuffle(questions)
told = {}
for number, method in questions:
    if order % 2:
        check(plans[number], every=True)
    found = envelope(plans[number], method=method, beta="1/2" if method == "irr" else None, timeout=20)
    if found.status is Status.COMPLETE:
        shown = sorted((name, side.value, stop.every) for (name, side), stop in found.stops.items())
        told[number, method] = str(found.box), shown
for key in sorted(told):
    if key[1] != "optimal":  # of several boxes that are as wide it is one
        print(key, told[key])
"""


def drawn_plans(seed: int, count: int) -> list[ParametrizedPlan]:
    """Valid plans with parameters, the same for the same seed."""
    found: list[ParametrizedPlan] = []

    @hypothesis_seed(seed)
    @settings(drawn(count), database=None)
    @given(parametric())
    def draw(plan: ParametrizedPlan) -> None:
        with suppress(InputError):
            if check(plan).answer is Answer.PROVED:
                found.append(plan)

    draw()
    return found


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_what_ends_a_side_does_not_depend_on_what_was_asked_before(seed) -> None:
    """Of fresh processes that ask in different orders, about other things as well, and hash in other ways."""
    count = "8" if seed == 1 else "400"
    answers = set()
    for order in range(2 if seed == 1 else 4):
        words = [sys.executable, "-c", ASKED, str(order), str(seed), count]
        environment = {**os.environ, "PYTHONHASHSEED": str(order)}
        answers.add(subprocess.run(words, capture_output=True, text=True, check=True, env=environment).stdout)
    (answer,) = answers
    assert answer.count("\n") >= int(count) / 5
