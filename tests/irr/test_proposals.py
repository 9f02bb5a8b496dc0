"""Widest boxes by shortest paths, held against the search that asks solvers, containment, and checks."""

from fractions import Fraction
from random import Random
from typing import Any

import pytest

from robust import Answer, ParametrizedPlan, RiskStatus, Status, check, envelope, risk
from robust.encode import create_encoding
from robust.encode.interface import EPSILON
from robust.execute.convert import Settings, convert
from robust.irr.containment import Containment
from robust.irr.exact import ExactSearch
from robust.irr.proposals import propose, tolerance
from robust.irr.stops import Tolerance
from robust.network.slack import FaceBound, OutsideFragmentError, SlackGraph, SlackRequirement
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.timed import parse_timed_plan
from robust.qe.box import Box, Interval, Side
from robust.smt.limits import NEVER
from tests.execute.plans import durative
from tests.sampling import often

STEP = Fraction(1, 10_000)


def drawn_plan(seed: int) -> ParametrizedPlan:
    """Steps with a parameter for each: resources, orders, fuel that durations burn, windows, deadlines."""
    random = Random(seed)  # noqa: S311 - no secret
    names = [f"a{number}" for number in range(random.randint(3, 7))]
    free: dict[str, Fraction] = {"r0": Fraction(0), "r1": Fraction(0)}
    ends: dict[str, Fraction] = {}
    raising: set[str] = set()
    actions, steps = [], []
    burning = random.random() < 0.4
    window = random.random() < 0.3
    for name in names:
        length = Fraction(random.choice([1, 2, 3, 5, 7, "5/2"]))
        used = random.sample(sorted(free), random.randint(0, 2))
        after = random.sample(sorted(ends), min(len(ends), random.randint(0, 2)))
        start = max([Fraction(0), *(ends[other] for other in after), *(free[one] for one in used)])
        start += random.choice([Fraction(1, 1000), Fraction(1, 100), Fraction(1), Fraction(5, 2)])
        lasting = [other for other in after if random.random() < 0.4]
        conditions = [*(f"(at start (done {one}))" for one in after), *(f"(at start (free {one}))" for one in used)]
        conditions += [f"(over all (done {one}))" for one in lasting] + ["(over all (open))"] * window
        effects = [f"(at end (done {name}))"]
        effects += [f"(at start (not (free {one}))) (at end (free {one}))" for one in used]
        if "r0" in used and random.random() < 0.5:
            effects.append("(at end (increase (level) 1))")
            raising.add(name)
        if raising & set(after) and random.random() < 0.5:
            conditions.append(f"(over all (>= (level) {len(raising & set(after))}))")
        if burning and random.random() < 0.7:
            effects.append("(at end (decrease (fuel) (* 2 ?duration)))")
            conditions += ["(at start (>= (fuel) 3))", "(at end (>= (fuel) 1))"][: random.randint(0, 2)]
        relation = random.choice(["=", "=", f">= {float(length - 1)}", f"<= {float(length + 4)}"])
        written = str(float(length)) if relation == "=" else relation
        actions.append(durative(name, written, " ".join(conditions) or "(at start (open))", " ".join(effects)))
        steps.append(f"{float(start)}: ({name}) [{float(length)}]")
        ends[name] = start + length
        free |= dict.fromkeys(used, start + length)
    last = max(ends.values())
    domain = (
        "(define (domain drawn) (:requirements :typing :durative-actions :fluents :timed-initial-literals) (:types o)"
        f"(:constants r0 r1 {' '.join(names)} - o) (:predicates (free ?r - o) (done ?a - o) (open))"
        "(:functions (fuel) (level))" + "\n".join(actions) + ")"
    )
    closing = f"(at {float(last + random.randint(1, 9))} (not (open)))" if window else ""
    fuel = 2 * sum(float(step.split("[")[1][:-1]) for step in steps) + random.choice([3, 4, 9])
    values = f"(= (fuel) {fuel}) (= (level) 0)"
    problem = (
        f"(define (problem drawn) (:domain drawn) (:init (free r0) (free r1) (open) {closing} {values})"
        f"(:goal (and {' '.join(f'(done {name})' for name in names)} (>= (fuel) 0))))"
    )
    weights = [f"duration:{name},weight={random.choice([1, 1, 2, '1/3'])}" for name in names]
    late = random.choice(["+10%", "+50%", "+1%", None, None, None])
    return made(domain, problem, "\n".join(steps), *weights, deadline=late, relative=random.random() < 0.4)


def made(domain: str, problem: str, plan: str, *specs: str, **settings: Any) -> ParametrizedPlan:
    parsed = parse_domain(domain)
    steps = parse_timed_plan(plan, "plan.txt")
    return convert(parsed, parse_problem(problem, parsed), steps, Settings(specs=parse_specs(specs), **settings)).plan


def asked_of_solvers(plan: ParametrizedPlan, monkeypatch: pytest.MonkeyPatch) -> ExactSearch:
    def outside(*_: object) -> None:
        raise OutsideFragmentError("asked of solvers")

    with monkeypatch.context() as patch:
        patch.setattr("robust.irr.proposals.propose", outside)
        search = ExactSearch(create_encoding("relational", plan, EPSILON, NEVER))
        assert search.run().status is Status.COMPLETE
    return search


def compared(seeds: range, monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """How many drawn plans shortest paths decide, all as solvers do, and why not the others."""
    reasons: dict[str, int] = {}
    for seed in seeds:
        plan = drawn_plan(seed)
        try:
            proposal = propose(plan, EPSILON, NEVER)
        except OutsideFragmentError as error:
            reasons[str(error)] = reasons.get(str(error), 0) + 1
            continue
        expected = asked_of_solvers(plan, monkeypatch)
        assert proposal.box == expected.box, seed
        result = envelope(plan)
        assert (result.box, result.fallback) == (expected.box, None), seed
        finite = {(name, side) for name in plan.nominal for side in Side if result.box[name].end(side) is not None}
        assert result.stops.keys() == finite
        reasons["decided"] = reasons.get("decided", 0) + 1
    return reasons


def test_boxes_are_those_that_solvers_find(monkeypatch) -> None:
    seeds = range(often(16, 500))
    assert compared(seeds, monkeypatch)["decided"] >= 0.8 * len(seeds)


def test_boxes_are_inside_and_end_where_plans_break() -> None:
    tried = 0
    for seed in range(100, 106):
        plan = drawn_plan(seed)
        result = envelope(plan)
        containment = Containment(create_encoding("relational", plan, EPSILON, NEVER))
        assert containment.contains(result.box, NEVER)
        for name in plan.nominal:
            for side in Side:
                end = result.box[name].end(side)
                if end is not None:
                    tried += 1
                    beyond = result.box.moved((name, side), end + side.sign * STEP)
                    assert not containment.contains(beyond, NEVER), (seed, name, side)
    assert tried > 30


def test_tolerances_are_the_greatest_that_checks_prove() -> None:
    known = 0
    for seed in range(200, 215):
        plan = drawn_plan(seed)
        found = check(plan).tolerance
        if found is None:
            continue
        known += 1
        assert found == tolerance(plan, EPSILON, NEVER, "z3") == envelope(plan).tolerance

        def all_within(ratio: Fraction, plan: ParametrizedPlan = plan) -> Answer:
            ends = {name: (value * (1 - ratio), value * (1 + ratio)) for name, value in plan.nominal.items()}
            return check(plan, at=Box({name: Interval(*pair) for name, pair in ends.items()})).answer

        assert all_within(found.ratio) is Answer.PROVED
        assert all_within(found.ratio + STEP) is Answer.REFUTED
        assert found.chain[-1]
    assert known >= 10


def test_tolerances_shrink_as_separation_grows() -> None:
    for plan in map(drawn_plan, range(400, 408)):
        answers = [tolerance(plan, EPSILON / share, NEVER, "z3") for share in (4, 2, 1)]
        ratios = [answer.ratio for answer in answers if answer is not None]
        assert len(ratios) == 3
        assert ratios == sorted(ratios, reverse=True)


def test_a_tolerance_names_the_chain_that_ends_it() -> None:
    actions = durative("one", "2", "(at start (open))", "(at end (first))")
    actions += durative("two", "3", "(at start (first))", "(at end (second))")
    domain = (
        "(define (domain chain) (:requirements :typing :durative-actions) (:predicates (open) (first) (second))"
        f"{actions})"
    )
    problem = "(define (problem chain) (:domain chain) (:init (open)) (:goal (second)))"
    plan = made(domain, problem, "0.001: (one) [2]\n2.002: (two) [3]", "duration:*", deadline=6)
    found = check(plan).tolerance
    assert found == Tolerance(Fraction(999, 5000), True, ("one (n0)", "two (n1)", "deadline: n1.end at most 6"))
    assert "up to 19.9 % (exactly 999/5000)" in str(found)


def test_risk_asks_first_whether_all_values_are_inside(monkeypatch) -> None:
    monkeypatch.setattr("robust.qe.compute.RegionSearch", None)
    plan = next(plan for plan in map(drawn_plan, range(300, 330)) if len(plan.parameters) > 6)
    ends = {name: (side.lower, side.upper) for name, side in envelope(plan).box.intervals.items()}
    ends = {name: (low, low + 50 if high is None else high) for name, (low, high) in ends.items()}
    spread = {name: f"uniform:{low}:{high}" for name, (low, high) in ends.items() if low != high}
    fixed = {name: f"constant:{low}" for name, (low, high) in ends.items() if low == high}
    result = risk(plan, {**spread, **fixed})
    assert (result.probability.lower, result.probability.upper, result.status) == (1, 1, RiskStatus.COMPLETE)


def graph(*faces: int, requirement: int, more: tuple[FaceBound, ...] = ()) -> SlackGraph:
    """Two ways from 0 to 2: over a distance with faces, and over others."""
    bounds = (FaceBound(0, 1, 5, faces[0], "first"), FaceBound(1, 2, 5, faces[1], "second"), *more)
    needed = SlackRequirement(0, 2, requirement, ["needed"])
    return SlackGraph(3, [0, 5, 10], bounds, [needed], [], [Fraction(1)] * 8)


def moved(network: SlackGraph) -> dict[int, Fraction]:
    for _ in network.events():
        pass
    return network.moved


def test_faces_of_a_path_share_its_slack() -> None:
    assert moved(graph(0, 2, requirement=7)) == {0: Fraction(3, 2), 2: Fraction(3, 2)}


def test_of_two_equal_paths_one_is_enough() -> None:
    """Both ways reach the budget together: the face that is asked first may go on, as long as the other one stays."""
    more = (FaceBound(0, 2, 10, 4, "direct"), FaceBound(0, 2, 10, 6, "direct as well"))
    assert moved(graph(0, 2, requirement=7, more=more)) == {6: Fraction(3)}


def test_values_cannot_be_chosen_twice_on_the_way_there_and_back() -> None:
    """The upper end of a distance and its lower one are no circle, however far apart they are."""
    more = (FaceBound(1, 0, -5, 1, "way back"), FaceBound(2, 0, -20, None, "latest"))
    found = moved(graph(0, 2, requirement=-9, more=more))
    assert (found[1], found[3]) == (5, 5)
