"""All room goes to the parameters first: no network that keeps more of the planner's distances has a wider box."""

from fractions import Fraction
from random import Random

import pytest

from robust import Answer, Box, Interval, InvalidPlanError, Status
from robust.encode import create_encoding
from robust.execute.convert import ConversionEnd, Mode
from robust.execute.room import RoomFirst
from robust.irr.exact import ExactSearch
from robust.plan.timed import parse_timed_plan
from robust.smt.limits import NEVER
from tests.execute.plans import EPSILON, converted, durative

BATTERY = f"""(define (domain battery)
(:requirements :durative-actions :numeric-fluents :continuous-effects :duration-inequalities)
(:predicates (idle) (docked) (there))
(:functions (battery))
{
    durative(
        "charge",
        ">= 1",
        "(at start (idle)) (over all (docked))",
        "(at start (not (idle))) (at end (idle)) (increase (battery) #t)",
    )
}
{
    durative(
        "drive",
        ">= 1",
        "(at start (idle)) (over all (>= (battery) 0))",
        "(at start (not (idle))) (at end (idle)) (at end (there)) (decrease (battery) #t)",
    )
})"""
EMPTY = "(define (problem p) (:domain battery) (:init (docked) (idle) (= (battery) 20)) (:goal (there)))"
CHARGED = "0.001: (charge) [20]\n20.002: (drive) [30]"


def widest(conversion):
    result = ExactSearch(create_encoding("relational", conversion.plan, EPSILON, NEVER)).run()
    assert result.status is Status.COMPLETE
    return result.box


@pytest.mark.parametrize(
    ("mode", "longest", "bounds"), [(Mode.ROOM, 40, 0), (Mode.CAUSAL, 30, 1), (Mode.ESTEREL, 40, 0)]
)
def test_a_drive_may_use_all_that_was_charged(mode, longest, bounds):
    conversion = converted(BATTERY, EMPTY, CHARGED, "duration:drive", mode=mode)
    assert widest(conversion) == Box({"dur_n1": Interval(Fraction(1), Fraction(longest))})
    assert len(conversion.tightened) == bounds
    notes = conversion.notes(parse_timed_plan(CHARGED, "plan.txt"))
    assert any("used up room" in note for note in notes) is (mode is Mode.CAUSAL)


def fleet(seed):
    """A domain, a problem and a plan in which robots charge and drive, with one battery each or one for all."""
    draw = Random(seed)  # noqa: S311
    shared = draw.random() < 0.5
    battery = "(battery)" if shared else "(battery ?r)"
    domain = f"""(define (domain fleet)
(:requirements :typing :durative-actions :numeric-fluents :continuous-effects :duration-inequalities)
(:types robot task)
(:predicates (idle ?r - robot) (dock-free) (done ?t - task))
(:functions {"(battery)" if shared else "(battery ?r - robot)"} (full))
(:durative-action charge :parameters (?r - robot) :duration (>= ?duration 1)
 :condition (and (at start (idle ?r)) (at start (dock-free)) (over all (<= {battery} (full))))
 :effect (and (at start (not (idle ?r))) (at end (idle ?r)) (at start (not (dock-free))) (at end (dock-free))
  (increase {battery} (* #t 2))))
(:durative-action drive :parameters (?r - robot ?t - task) :duration (>= ?duration 1)
 :condition (and (at start (idle ?r)) (over all (>= {battery} 0)))
 :effect (and (at start (not (idle ?r))) (at end (idle ?r)) (at end (done ?t)) (decrease {battery} #t))))"""
    robots = ["r1", "r2"][: draw.randint(1 + shared, 2)]
    free = dict.fromkeys((*robots, "dock"), Fraction(0))
    steps, tasks = [], []
    for _ in range(draw.randint(3, 6)):
        robot = draw.choice(robots)
        start, length = free[robot] + Fraction(draw.choice([1, 1, 500]), 1000), Fraction(draw.randint(1, 9))
        if draw.random() < 0.4:
            start = max(start, free["dock"] + Fraction(1, 1000))
            step, free["dock"] = f"(charge {robot})", start + length
        else:
            tasks.append(f"t{len(tasks)}")
            step = f"(drive {robot} {tasks[-1]})"
        free[robot] = start + length
        steps.append((start, step, length))
    levels = "(= (battery) {0})" if shared else " ".join(f"(= (battery {robot}) {{0}})" for robot in robots)
    problem = f"""(define (problem p) (:domain fleet)
(:objects {" ".join(robots)} - robot {" ".join(tasks) or "t"} - task)
(:init (dock-free) (= (full) {draw.randint(20, 40)}) {" ".join(f"(idle {robot})" for robot in robots)}
 {levels.format(draw.randint(5, 20))})
(:goal (and (dock-free) {" ".join(f"(done {task})" for task in tasks)})))"""
    plan = "\n".join(f"{float(start):.3f}: {step} [{length}]" for start, step, length in sorted(steps))
    varying = [f"duration:n{number}" for number in range(len(steps)) if draw.random() < 0.7]
    return domain, problem, plan, varying or ["duration:n0"]


@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 158), marks=pytest.mark.slow)])
def test_no_network_with_more_of_the_planners_distances_has_a_wider_box(seeds, monkeypatch):
    """Of the transformer's network, of its orders alone, and of all gaps as planned, on plans that charge and drive."""
    rungs = []
    original = RoomFirst._rung
    monkeypatch.setattr(RoomFirst, "_rung", lambda *args: rungs.append(original(*args)) or rungs[-1])
    compared = needing = 0
    for seed in seeds:
        texts = fleet(seed)
        rungs.clear()
        try:
            conversion = converted(*texts[:3], *texts[3], mode=Mode.ROOM)
        except InvalidPlanError:
            continue
        assert conversion.check.answer is Answer.PROVED
        assert conversion.ended is ConversionEnd.COMPLETE
        box = widest(conversion)
        # The first rung is the loosest. Boxes of the others may have different shapes, which no network keeps both.
        others = [rung.box for rung in rungs[1:]]
        assert not others or any(other.is_within(box) for other in others), (seed, box)
        one_shape = not others or any(all(other.is_within(largest) for other in others) for largest in others)
        assert not one_shape or all(other.is_within(box) for other in others), (seed, box)
        transformed = converted(*texts[:3], *texts[3], mode=Mode.ESTEREL)
        if transformed.check.answer is Answer.PROVED:
            assert widest(transformed).is_within(box) or not one_shape, seed
        compared += one_shape
        needing += bool(conversion.tightened)
        for bound in conversion.tightened:  # none of them is for nothing, and the plan itself keeps each
            assert bound.own >= bound.edge.weight
    assert compared >= len(seeds) // 3
    assert needing >= len(seeds) // 20
