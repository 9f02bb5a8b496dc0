"""Regions with times, against enumerated ones, back ends, checks and projections; answers depend on no earlier ones."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from random import Random
from time import process_time
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import seed as hypothesis_seed

import robust
from robust import Answer, Box, InputError, Interval, ParametrizedPlan, Region, Status, UnsupportedError, check, region
from robust.backends import ELIMINATORS
from robust.encode.encoding import RelationalEncoding
from robust.execute.distances import InvalidPlanError
from robust.plan.simulate import simulate
from robust.qe import compute, constraint, nnf
from robust.qe.lifted import LiftedRegion, lifted_envelope
from robust.smt.limits import NEVER
from tests.execute.plans import durative
from tests.irr.building import parametric
from tests.irr.test_proposals import drawn_plan, made
from tests.plan.building import drawn
from tests.sampling import often

Point = dict[str, Fraction]


def job_shop(jobs: int, machines: int, seed: int = 0, deadline: str = "+10%") -> ParametrizedPlan:
    """Each job once on each machine, in an order of its own; a parameter for each duration."""
    random = Random(seed)  # noqa: S311 - no secret
    free = {f"m{number}": Fraction(0) for number in range(machines)}
    ready = [Fraction(0)] * jobs
    orders = [random.sample(sorted(free), machines) for _ in range(jobs)]
    turns = [job for job in range(jobs) for _ in range(machines)]
    random.shuffle(turns)
    actions, steps, names = [], [], list[str]()
    for position, job in enumerate(turns):
        number = turns[:position].count(job)
        name, machine, length = f"o{job}x{number}", orders[job][number], random.randint(2, 9)
        start = max(ready[job], free[machine]) + Fraction(1, 100)
        before = f"(at start (done o{job}x{number - 1}))" if number else ""
        effects = f"(at start (not (free {machine}))) (at end (free {machine})) (at end (done {name}))"
        actions.append(durative(name, str(length), f"(at start (free {machine})) {before}", effects))
        steps.append((start, f"{float(start)}: ({name}) [{length}]"))
        ready[job] = free[machine] = start + length
        names.append(name)
    objects = " ".join((*free, *names))
    domain = (
        "(define (domain shop) (:requirements :typing :durative-actions) (:types o)"
        f"(:constants {objects} - o) (:predicates (free ?m - o) (done ?a - o)) {' '.join(actions)})"
    )
    initially = " ".join(f"(free {machine})" for machine in free)
    goal = " ".join(f"(done {name})" for name in names)
    problem = f"(define (problem shop) (:domain shop) (:init {initially}) (:goal (and {goal})))"
    plan = "\n".join(text for _, text in sorted(steps))
    return made(domain, problem, plan, *(f"duration:{name}" for name in names), deadline=deadline)


def lifted(plan: ParametrizedPlan) -> LiftedRegion:
    known = lifted_if_possible(plan)
    assert known is not None
    return known


def lifted_if_possible(plan: ParametrizedPlan) -> LiftedRegion | None:
    encoding = RelationalEncoding(plan)
    return lifted_envelope(encoding, nnf.FormulaReader(encoding.terms), NEVER)


def rows(region: LiftedRegion, plan: ParametrizedPlan, count: int, seed: int) -> list[list[int]]:
    """Hundredths of parameters, inside and outside."""
    random = Random(seed)  # noqa: S311 - no secret
    spread = [random.choice([0, 2, 10, 30, 100]) for _ in range(count)]
    nominal = [plan.nominal[name] for name in region.parameters]
    return [[int(value * random.randint(100 - most // 2, 100 + most)) for value in nominal] for most in spread]


def points(region: LiftedRegion, numerators: list[list[int]], unit: int = 100) -> Iterator[Point]:
    for row in numerators:
        yield {name: Fraction(value, unit) for name, value in zip(region.parameters, row, strict=True)}


def hunt(plan: ParametrizedPlan, backend: str, seed: int) -> int:
    """Hold a region against an enumerated one: points, optima, intervals, slices, documents; how many points it has."""
    region = lifted(plan)
    expected = compute.RegionSearch(plan, backend=backend, lift=False).run()
    assert expected.status is Status.COMPLETE
    assert Region.difference(region.base, ()).equals(expected.region)
    whole = expected.region.as_difference().simplified()
    base = whole.base
    assert base is not None
    assert not whole.pieces
    random = Random(seed)  # noqa: S311 - no secret
    for _ in range(5):
        objective = {name: Fraction(random.randint(-2, 2)) for name in region.parameters}
        known, wanted = region.maximize(objective), base.maximize(objective)
        assert known is not None
        assert (known.value, known.attained) == (wanted.value, wanted.attained)
    numerators = rows(region, plan, 60, seed)
    drawn = list(points(region, numerators))
    inside = [point in expected.region for point in drawn]
    again = LiftedRegion.from_dict(region.as_dict())
    assert [point in again for point in drawn] == inside == region.contains_many(numerators, 100)
    for point, good in zip(drawn, inside, strict=True):
        assert bool(region.contradiction(point)) is not good
        schedule = region.schedule(point)
        assert (schedule is not None) is good
        assert schedule is None or simulate(plan, point, schedule).valid
    fixed = {name: plan.nominal[name] for name in region.parameters[1:]}
    assert region.slice(fixed).equals(expected.region.slice(fixed))
    assert region.interval(region.parameters[0], plan.nominal) == base.slice(fixed).extent(region.parameters[0])
    for share in (Fraction(1, 100), Fraction(1, 20), Fraction(1, 2)):
        ends = {name: Interval(value * (1 - share), value * (1 + share)) for name, value in plan.nominal.items()}
        outside = region.point_outside(Region.of_box(region.parameters, Box(ends)))
        assert (outside is None) is expected.region.contains_box(Box(ends))
        assert outside is None or outside not in expected.region
    return sum(inside)


def test_regions_with_times_are_those_that_are_enumerated():
    """Some drawn plans are invalid, and some have none: their obligations are about times. Most have one."""
    more = list[int]()
    for seed in range(100, often(100, 250)):
        with suppress(InvalidPlanError):
            more += [seed] if lifted_if_possible(drawn_plan(seed)) is not None else []
    counts = [hunt(drawn_plan(seed), "project", seed) for seed in (3, 31, 42, 56, *more)]
    assert 20 < sum(counts) < 60 * len(counts) - 20
    assert len(counts) >= often(4, 140)


@pytest.mark.parametrize("backend", ELIMINATORS)
def test_regions_with_times_are_those_of_all_back_ends(backend):
    hunt(drawn_plan(32), backend, 0)


@pytest.mark.parametrize(
    "shape", [(2, 4), pytest.param((3, 4), marks=pytest.mark.slow), pytest.param((4, 4), marks=pytest.mark.slow)]
)
def test_job_shops_are_those_that_are_enumerated(shape):
    plan = job_shop(*shape)
    hunt(plan, "project", 1)
    assert region(plan).region.equals(compute.RegionSearch(plan, lift=False).run().region)


def test_a_shop_with_36_durations_is_complete_and_as_checked(monkeypatch):
    plan = job_shop(6, 6)
    started = process_time()
    result = region(plan)
    assert process_time() - started < 5
    known = result.region
    assert result.is_exact
    assert known is result.lifted
    numerators = rows(known, plan, 6, 3)
    answers = [check(plan, at=point).answer for point in points(known, numerators)]
    assert {Answer.PROVED, Answer.REFUTED} == set(answers)
    assert known.contains_many(numerators, 100) == [answer is Answer.PROVED for answer in answers]
    most = known.maximize(dict.fromkeys(known.parameters, Fraction(1)))
    assert most.attained
    assert most.point in known
    assert {name: value + Fraction(1, 10**6) for name, value in most.point.items()} not in known
    sides = [constraint.LinearConstraint.of({name: 1}, "<=", known.extent(name).upper) for name in known.parameters]
    assert all(map(known.satisfies, sides[:3]))
    assert result.as_dict()["form"] == "lifted"
    monkeypatch.setattr("robust.qe.lifted.MOST", 100)
    with pytest.raises(UnsupportedError, match="more than 100 inequalities"):
        _ = known.base


def test_tolerances_grow_with_the_deadline():
    for seed in range(4):
        known = [check(job_shop(2, 3, seed, deadline)).tolerance for deadline in ("+2%", "+5%", "+20%", "+80%")]
        ratios = [one.ratio for one in known if one is not None]
        assert len(ratios) == len(known)
        assert ratios == sorted(set(ratios))


def test_large_numbers_are_exact():
    plan = job_shop(2, 4)
    known = lifted(plan)
    edge = known.interval(known.parameters[0], plan.nominal).upper
    unit = 10**30
    row = [int(plan.nominal[name] * unit) for name in known.parameters]
    row[0] = edge.numerator * unit // edge.denominator
    assert known.contains_many([row, [row[0] + 1, *row[1:]]], unit) == [True, False]


def test_what_is_no_difference_constraint_is_refused():
    for coefficients, relation in (({"x": 1, "y": 1}, "<="), ({"x": 2, "y": -1}, "<="), ({"x": 1}, "<")):
        with pytest.raises(InputError, match="no difference constraint"):
            LiftedRegion(("a",), ("x", "y"), [constraint.LinearConstraint.of({**coefficients, "a": 1}, relation, 1)])
    with pytest.raises(InputError, match="cannot read a region"):
        LiftedRegion.from_dict({"parameters": ["a"]})


ASKED = """
import json, sys
from tests.qe.test_lifted import answers, drawn_plans
order, seed, count = map(int, sys.argv[1:])
for answer in answers(order, drawn_plans(seed, count)):
    print(json.dumps(answer))
"""
METHODS = ("widen", "irr", "optimal")
Questions = Iterator[tuple[int, str, dict[str, Any] | None]]


def drawn_plans(seed: int, count: int) -> list[ParametrizedPlan]:
    """Plans with parameters, valid or not; the same for the same seed, as long as the same modules are imported."""
    plans: list[ParametrizedPlan] = []

    @hypothesis_seed(seed)
    @settings(drawn(count), database=None)
    @given(parametric(parameters=3))
    def draw(plan: ParametrizedPlan) -> None:
        plans.append(plan)

    draw()
    return plans


def answer(plan: ParametrizedPlan, verb: str) -> dict[str, Any] | None:
    """What a verb, or the search for a box by a method, says of a plan; None if that takes too long."""
    try:
        if verb in METHODS:
            result = robust.envelope(plan, method=verb, beta="1/2" if verb == "irr" else None, timeout=20)
            if result.status is not Status.COMPLETE or verb == "optimal":  # of several boxes that are as wide it is any
                return None
            stops = sorted((name, side.value, stop.every) for (name, side), stop in result.stops.items())
            return {"box": str(result.box), "stops": stops}
        if verb == "region":
            region = robust.region(plan, timeout=20)
            return {"region": region.region.as_dict()} if region.is_exact else None
        spread = {one.name: f"uniform:{one.nominal - 2}:{one.nominal + 2}" for one in plan.parameters}
        risk = robust.risk(plan, spread, within="1/100", timeout=20)
    except InputError as error:
        return {"error": str(error)}
    bounds = {share.name: share.probability for share in risk.shares or ()} | {"success": risk.probability}
    bounds |= {kept.method: kept.probability for kept in risk.kept if kept.method != "optimal"}
    return None if risk.cut_short else {name: [str(one.lower), str(one.upper)] for name, one in bounds.items()}


def answers(order: int, plans: list[ParametrizedPlan]) -> Questions:
    """What verbs say of plans, asked in some order and, in every other order, about boxes in between."""
    questions = [(number, verb) for number in range(len(plans)) for verb in ("region", "risk", *METHODS)]
    Random(order).shuffle(questions)  # noqa: S311 - reproducible orders
    for number, verb in questions:
        if order % 2:
            with suppress(InputError):
                robust.check(plans[number], every=True)
                robust.envelope(plans[number], timeout=20)
        yield number, verb, answer(plans[number], verb)


def same(verb: str, before: dict[str, Any], after: dict[str, Any]) -> bool:
    """A region is one set of points, however it is described; bounds on one probability overlap."""
    if verb in METHODS or "error" in before or "error" in after:
        return before == after
    if verb == "region":
        return Region.from_dict(before["region"]).equals(Region.from_dict(after["region"]))
    bounds = (map(Fraction, (*before.get(name, "00"), *after.get(name, "00"))) for name in {**before, **after})
    return all(max(low, other) <= min(high, most) for low, high, other, most in bounds)


def assert_same(first: Questions, second: Questions, least: int) -> None:
    """No question has two answers; at least that many have any."""
    known = {(number, verb): said for number, verb, said in first}
    pairs = [(verb, known.get((number, verb)), said) for number, verb, said in second]
    both = [(verb, before, after) for verb, before, after in pairs if before is not None and after is not None]
    assert [pair for pair in both if not same(*pair)] == []
    assert len(both) >= least


@pytest.mark.parametrize(
    ("seed", "order", "count"),
    [(1, 1, 3), *(pytest.param(seed, order, 60, marks=pytest.mark.slow) for seed in range(1, 4) for order in (1, 2))],
)
def test_fresh_processes_agree(seed: int, order: int, count: int) -> None:
    """They ask in different orders, about other things as well, and hash in other ways."""

    def asked(order: int) -> Questions:
        words = [sys.executable, "-c", ASKED, str(order), str(seed), str(count)]
        environment = {**os.environ, "PYTHONHASHSEED": str(order)}
        return map(json.loads, subprocess.check_output(words, text=True, env=environment).splitlines())

    assert_same(asked(0), asked(order), 2 * count)
