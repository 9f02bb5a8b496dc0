"""By how much actions may exceed their planned durations: what is said is proved, and tight where it can be."""

from fractions import Fraction
from pathlib import Path

import pytest

import robust
from robust.irr.overruns import FIXED, action_overruns, overruns
from robust.qe.box import Box, Interval

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"
JUST = Fraction(1, 10**6)

DOMAIN = """(define (domain d) (:requirements :durative-actions :fluents :duration-inequalities)
(:predicates (ready) (done))
(:functions (time) (pace) (left))
(:durative-action move :parameters () :duration (>= ?duration 0) :condition () :effect (at end (ready)))
(:durative-action load :parameters () :duration (and (>= ?duration 0) (<= ?duration 40)) :condition ()
  :effect (at end (done)))
(:durative-action pass :parameters () :duration (= ?duration (pace)) :condition () :effect (at end (done)))
(:durative-action use :parameters () :duration (>= ?duration 0) :condition () :effect (at end (decrease (left) (pace))))
(:durative-action slow :parameters () :duration (= ?duration (+ 10 (* 2 (pace)))) :condition () :effect (at end (done)))
(:durative-action rest :parameters () :duration (= ?duration (- 15 (pace))) :condition () :effect (at end (done)))
(:action ring :parameters () :precondition () :effect (done)))"""
PROBLEM = "(define (problem p) (:domain d) (:init (= (time) 0) (= (pace) 5) (= (left) 100)) (:goal (done)))"
HEAD = (
    "durative-action instance m : (move);\ndurative-action instance n : (move);\ndurative-action instance l : (load);\n"
)


def plan_of(tmp_path, text, **options):
    (tmp_path / "d.pddl").write_text(DOMAIN)
    (tmp_path / "p.pddl").write_text(PROBLEM)
    (tmp_path / "x.stn").write_text(text)
    return robust.load_plan(tmp_path / "d.pddl", tmp_path / "p.pddl", tmp_path / "x.stn", **options)


def box(**ends):
    return Box(
        {
            name: Interval(Fraction(lower), None if upper is None else Fraction(upper), upper_closed=upper is not None)
            for name, (lower, upper) in ends.items()
        }
    )


def example(name, plan="plan.stn", **options):
    return robust.load_plan(*(EXAMPLES / name / file for file in ("domain.pddl", "problem.pddl", plan)), **options)


# -- proved, and tight -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("two_sample_navigation", ["duration:drive_3", "duration:take-sample"]),
        ("delivery", ["duration:move"]),
        ("delivery", []),
    ],
)
def test_durations_within_the_percentages_are_valid_and_more_is_not(name, parameters):
    plan = example(name, parameters=parameters)
    found = robust.envelope(plan)
    parameter_of = {one.instance.identifier: one.parameters for one in overruns(plan, found.box)}
    actions = action_overruns(plan, found.box)
    scaled = {}
    for action in actions:
        for one in action.overruns:
            if one.reason is None:
                (parameter,) = parameter_of[one.instance.identifier]
                scaled[parameter] = one.planned * (1 + action.percent / 100)
    assert set(scaled) == {one.name for one in plan.parameters}
    assert robust.check(plan, at=scaled).answer.value == "proved"
    # All durations from the planned ones up to those, in any combination.
    ranges = {name: Interval(plan.nominal[name], value) for name, value in scaled.items()}
    assert robust.check(plan, at=ranges).answer.value == "proved"
    tight = 0
    for action in actions:
        decisive = action.decisive
        if decisive is not None and decisive.reason is None and action.percent:
            (parameter,) = parameter_of[decisive.instance.identifier]
            # The others at the values at which the box ends: a box that cannot be widened is stopped by some corner.
            beyond = decisive.planned * (1 + (action.percent + JUST) / 100)
            corner = {one: found.box[one] for one in found.box.intervals}
            assert beyond > found.box[parameter].upper
            assert robust.check(plan, at={**corner, parameter: beyond}).answer.value == "refuted"
            tight += 1
    assert tight


def test_the_least_of_several_instances(tmp_path):
    text = "parameter a default 10;\nparameter b default 20;\nparameter c default 30;\n" + HEAD
    text += "c: m.end - m.start in [a, a];\nc: n.end - n.start in [b, b];\nc: l.end - l.start in [c, c];\n"
    plan = plan_of(tmp_path, text)
    move, load = action_overruns(plan, box(a=(0, 15), b=(0, 25), c=(0, 33)))
    assert (move.action, move.percent, move.decisive.instance.identifier) == ("move", 25, "n")
    assert [one.percent for one in move.overruns] == [50, 25]
    assert [one.shortest for one in action_overruns(plan, box(a=(4, 15), b=(0, 25), c=(0, 33)))[0].overruns] == [4, 0]
    assert (load.action, load.percent) == ("load", 10)
    # what the domain says ends it before the box does
    (_, load) = action_overruns(plan, box(a=(0, 15), b=(0, None), c=(0, None)))
    assert load.percent == Fraction(100, 3)


def test_open_ends(tmp_path):
    text = "parameter a default 10;\nparameter b default 20;\n" + HEAD
    text += "c: m.end - m.start in [a, a];\nc: n.end - n.start in [b, b];\nc: l.end - l.start in [3, 3];\n"
    plan = plan_of(tmp_path, text)
    open_box = Box(
        {"a": Interval(Fraction(0), Fraction(12), upper_closed=False), "b": Interval(Fraction(0), Fraction(24))}
    )
    (move, _) = action_overruns(plan, open_box)
    assert (move.percent, move.closed) == (20, False)


@pytest.mark.parametrize(
    ("bound", "ends", "percent"),
    [
        ("[a, a]", (5, None), None),  # any longer one
        ("[a, a]", (10, 10), 0),
        ("[0, a]", (5, 12), 20),  # at most as planned
    ],
)
def test_bounds_of_durations(tmp_path, bound, ends, percent):
    text = "parameter a default 10;\ndurative-action instance m : (move);\ndurative-action instance l : (load);\n"
    text += f"c: m.end - m.start in {bound};\nc: l.end - l.start in [3, 3];\n"
    (move, load) = action_overruns(plan_of(tmp_path, text), box(a=ends))
    assert move.percent == percent
    assert (load.percent, load.decisive.reason) == (0, FIXED)


# -- what is not proved ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("constraints", "reason"),
    [
        # The same parameter for two durations: only that both are as long is proved.
        ("c: m.end - m.start in [a, a];\nc: n.end - n.start in [a, a];\n", "the duration of n"),
        ("c: m.end - m.start in [a, a];\nc: n.end - n.start in [5, 5];\nc: l.start - .zero in [a, a];\n", "l.start"),
    ],
)
def test_parameters_that_stand_for_more_than_one_duration(tmp_path, constraints, reason):
    text = "parameter a default 10;\n" + HEAD + constraints + "c: l.end - l.start in [3, 3];\n"
    (move, _) = action_overruns(plan_of(tmp_path, text), box(a=(5, 20)))
    assert move.percent == 0
    assert move.overruns[0].planned == move.overruns[0].proved == 10
    assert reason in move.overruns[0].reason


def test_fluents_that_are_parameters(tmp_path):
    text = "durative-action instance q : (pass);\nc: q.start - .zero in [1, 1];\n"
    plan = plan_of(tmp_path, text, parameters=["fluent:(pace)"])
    (only,) = action_overruns(plan, box(pace=(1, 6)))
    assert (only.percent, only.overruns[0].parameters) == (20, ("pace",))
    plan = plan_of(tmp_path, f"{text}durative-action instance u : (use);\n", parameters=["fluent:(pace)"])
    (q, u) = action_overruns(plan, box(pace=(1, 6)))
    assert (q.percent, u.percent) == (0, 0)
    assert "what u reads or writes" in q.overruns[0].reason
    assert u.overruns[0].reason == "nothing says how long it takes"


@pytest.mark.parametrize(("action", "percent"), [("slow", 10), ("rest", 40)])
def test_durations_that_are_sums(tmp_path, action, percent):
    """Of (pace), 5, which may be from 1 to 6: 10 and twice as much; 15 less as much."""
    plan = plan_of(tmp_path, f"durative-action instance i : ({action});\n", parameters=["fluent:(pace)"])
    (only,) = action_overruns(plan, box(pace=(1, 6)))
    assert only.percent == percent


def test_durations_of_zero(tmp_path):
    text = "parameter a default 0;\nparameter b default 10;\n" + HEAD
    text += "c: m.end - m.start in [a, a];\nc: n.end - n.start in [b, b];\nc: l.end - l.start in [0, 0];\n"
    plan = plan_of(tmp_path, text)
    (move, load) = action_overruns(plan, box(a=(0, 5), b=(0, 15)))
    assert (move.percent, move.decisive.instance.identifier) == (50, "n")  # any share of nothing is nothing
    assert load.percent == 0


def test_instantaneous_actions_have_no_duration(tmp_path):
    text = "action instance r : (ring);\nc: r - .zero in [1, 1];\n"
    assert action_overruns(plan_of(tmp_path, text), Box({})) == ()
