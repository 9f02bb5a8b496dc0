"""Room goes to the parameters first; deadlines, and widths in proportion to nominal values."""

from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

import robust
from robust import Answer, Box, InputError, Interval, InvalidPlanError, Location, Status
from robust.encode import create_encoding
from robust.execute.convert import ConversionEnd, Mode
from robust.execute.parametrization import earliest_end, latest_end, with_deadline
from robust.execute.room import RoomFirst
from robust.irr.exact import ExactSearch
from robust.plan.stn import parse_stn, write_stn
from robust.plan.timed import parse_timed_plan
from robust.smt.limits import NEVER
from tests.execute.plans import EPSILON, converted, durative
from tests.tables import text_in_data

BATTERY = text_in_data(__file__, "battery.pddl")
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


def test_of_changes_at_one_time_that_a_comparison_waits_for_the_transformer_takes_the_first_of_the_plan():
    names = [f"level{number}" for number in range(8)]
    filling = [durative(f"fill-{name}", "5", "", f"(at end (increase ({name}) 1))") for name in names]
    using = durative("use", "2", f"(at start (>= (+ {' '.join(f'({name})' for name in names)}) 8))", "(at end (used))")
    conversion = converted(
        f"(define (domain d) (:predicates (used)) (:functions {' '.join(f'({name})' for name in names)})"
        f" {' '.join(filling)} {using})",
        f"(define (problem p) (:domain d) (:init {' '.join(f'(= ({name}) 0)' for name in names)}) (:goal (used)))",
        "\n".join([*(f"0: (fill-{name}) [5]" for name in names), "6: (use) [2]"]),
        mode=Mode.ESTEREL,
    )
    before = [bound.source for bound in conversion.plan.constraints if str(bound.target) == "n8.start"]
    assert list(map(str, before)) == ["n0.end"]


def test_a_rate_beside_durations_gets_the_network_of_its_nominal_value():
    domain = BATTERY.replace("(battery))", "(battery) (drain))").replace(
        "(decrease (battery) #t)", "(decrease (battery) (* #t (drain)))"
    )
    problem = EMPTY.replace("(idle)", "(idle) (= (drain) 1)")
    both = converted(domain, problem, CHARGED, "duration:drive", "fluent:(drain)", mode=Mode.ROOM)
    assert both.stn == converted(domain, problem, CHARGED, "duration:drive", mode=Mode.ROOM).stn
    assert set(both.plan.nominal) == {"dur_n1", "drain"}
    assert robust.check(both, at={"dur_n1": (1, 32), "drain": (0, Fraction(5, 4))}).answer is Answer.PROVED
    assert robust.check(both, at={"dur_n1": 32, "drain": Fraction(4, 3)}).answer is Answer.REFUTED


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


PLACE = Location("--deadline")
NETWORK = """\
parameter k default 3;
durative-action instance n0 : (one);
durative-action instance n1 : (two);
c: n0.end - n0.start in [2, 9];
c: n1.end - n1.start in [k, k];
c: n1.start - n0.end in [1, inf];
"""
DOMAIN = (
    "(define (domain chain) (:requirements :typing :durative-actions) (:predicates (open) (first) (second))"
    + durative("one", "2", "(at start (open))", "(at end (first))")
    + durative("two", "3", "(at start (first))", "(at end (second))")
    + ")"
)
PROBLEM = "(define (problem chain) (:domain chain) (:init (open)) (:goal (second)))"
STEPS = "0.001: (one) [2]\n2.002: (two) [3]\n"


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """A domain, a problem and steps."""
    paths = [tmp_path / name for name in ("domain.pddl", "problem.pddl", "plan.log")]
    for path, text in zip(paths, (DOMAIN, PROBLEM, STEPS), strict=True):
        path.write_text(text)
    return paths


@pytest.mark.parametrize(("text", "latest"), [("90", 90), ("+10%", 22), (" + 2.5 % ", "20.5"), (7, 7), ("1/3", "1/3")])
def test_deadlines_are_times_or_relative_to_the_end(text: str | int, latest: int | str) -> None:
    assert latest_end(text, Fraction(20), PLACE) == Fraction(latest)


@pytest.mark.parametrize("text", ["soon", "+10", "10%", "+ten%", ""])
def test_other_deadlines_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"--deadline: found .*, expected"):
        latest_end(text, Fraction(20), PLACE)


def test_a_network_ends_at_the_earliest_with_nominal_values() -> None:
    network = parse_stn(NETWORK)
    assert earliest_end(network) == 6
    late = with_deadline(network, "+50%", PLACE)
    assert [str(bound.upper) for bound in late.constraints[3:]] == ["9", "9"]
    assert parse_stn(write_stn(late)).constraints == late.constraints
    assert "c: n1.end - .zero in [-inf, 9];  # deadline" in write_stn(late)
    with pytest.raises(InputError, match="without schedule at nominal values"):
        earliest_end(parse_stn(NETWORK + "c: n1.end - .zero in [0, 5];"))


def test_steps_end_when_they_are_planned(files: list[Path]) -> None:
    plan = robust.load_plan(*files, parameters=["duration:*"], deadline="+20%", widths="relative")
    assert [parameter.weight for parameter in plan.parameters] == [2, 3]
    assert plan.constraints[-1].upper.constant_term == Fraction("5.002") * Fraction(6, 5)
    result = robust.envelope(plan)
    stretch = 1 + result.tolerance.ratio
    assert [result.box[name].upper for name in ("dur_n0", "dur_n1")] == [2 * stretch, 3 * stretch]
    assert result.tolerance.ratio == (Fraction("5.002") * Fraction(6, 5) - Fraction("5.001")) / 5
    assert {stop.statements[-1] for (_, side), stop in result.stops.items() if side.value == "upper"} == {
        "deadline: n1.end at most 6.0024"
    }
    converted = robust.convert(*files, parameters=["duration:*"], deadline="+20%", widths="relative")
    assert converted.plan.constraints == plan.constraints
    assert [parameter.weight for parameter in converted.stn.parameters] == [2, 3]


def test_a_deadline_before_the_planned_end_is_met_by_starting_earlier(files: list[Path]) -> None:
    files[2].write_text("5: (one) [2]\n9: (two) [3]\n")
    assert robust.check(robust.load_plan(*files, deadline=6)).answer is Answer.PROVED
    with pytest.raises(InputError, match=r"no schedule: .*deadline: n1.end at most 5"):
        robust.load_plan(*files, deadline=5)
