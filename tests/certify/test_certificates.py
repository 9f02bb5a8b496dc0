"""Certificates of every kind: made, accepted by the checker, and only for what is true."""

from __future__ import annotations

import warnings
from fractions import Fraction

import pytest

from benchmarks.generators.team_plans import Shape, random_plan
from benchmarks.suite import read_deliveries, read_suite
from robust.api import check, envelope, region
from robust.certify.alethe import export
from robust.certify.bad import declared_bounds, face_lines, region_lines
from robust.certify.checker import reader
from robust.certify.checker.formulas import Formulas
from robust.certify.produce import PlanCertificate, knowledge
from robust.certify.tape import (
    OrderLemmas,
    affine_times,
    box_facts,
    constant_times,
    good_lines,
    header,
    positive_circle,
)
from robust.encode import create_encoding
from robust.encode.encoding import RelationalEncoding
from robust.errors import InputError, RefutedError, UnsupportedError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.plan.load import load_plan
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline, OutOfTimeError
from tests.certify import tools
from tests.certify.texts import Texts, random_texts
from tests.pike_bridge.satisfiability import sat_plan

KINDS = ("plan", "box", "maximal", "region")
examples = pytest.mark.parametrize("files", [tools.NAVIGATION, tools.GENERATOR], ids=["navigation", "generator"])


@examples
@pytest.mark.parametrize("kind", KINDS)
def test_examples(files, kind) -> None:
    claim = tools.judged(tools.made(files, kind), tools.grounded(files))
    assert not isinstance(claim, str), claim
    assert (claim.kind, claim.epsilon) == (kind, tools.EPSILON)


def test_recorded_plans(dataset) -> None:
    """One of each family; all are certified by `python -m benchmarks.certificates`."""
    recorded = {one.name: one.files for one in read_suite(dataset)}
    recorded |= {one.instance: files for one, files in read_deliveries(dataset)}
    for name in ("auv_mission_10_0_3", "generator_linear_05_2", "solar_rover_01_3", "delivery_g02_w06"):
        for kind in KINDS[:3]:
            claim = tools.judged(tools.made(recorded[name], kind), tools.grounded(recorded[name]))
            assert not isinstance(claim, str), (name, kind, claim)
    for name in ("generator_linear_05_2", "solar_rover_01_2"):
        assert not isinstance(tools.judged(tools.made(recorded[name], "region"), tools.grounded(recorded[name])), str)


@pytest.mark.parametrize("first", range(0, 60, 10))
def test_random_plans(first) -> None:
    """A plan has a certificate if and only if it is valid; so have its widest box and its region."""
    done = 0
    for seed in range(first, first + 10):
        texts = random_texts(seed, easy=True)
        try:
            plan = tools.assembled(texts)
            proved = check(plan).answer.name == "PROVED"
        except (InputError, UnsupportedError):
            continue
        ground = reader.ground(*texts)
        nominal = Box.nominal(plan.parameters)
        try:
            lines = [header("plan"), *good(ground, nominal)]
            assert not isinstance(tools.judged(lines, ground), str)
            certified = True
        except RefutedError:
            certified = False
        assert certified == proved
        done += 1
        if proved and plan.parameters:
            box = envelope(plan).box
            faces = face_lines(
                ground, create_encoding("relational", plan), box, solver="z3", deadline=Deadline.after(60)
            )
            lines = [header("maximal", box), *good(ground, box), *faces]
            assert not isinstance(tools.judged(lines, ground), str)
        if plan.parameters:
            found = region_lines(ground, tools.EPSILON, region(plan).region, deadline=Deadline.after(60))
            assert not isinstance(tools.judged([header("region"), *found], ground), str)
    assert done > 4


def good(ground, box):
    return good_lines(ground, tools.EPSILON, box, solver="z3", deadline=Deadline.after(60))


SMALL = """(define (domain d) (:predicates (p)) (:functions (f))
 (:durative-action a :parameters () :duration (and (>= ?duration 1) (<= ?duration 1)) :condition {}
  :effect (and (at start (increase (f) 1)) (at end (p)))))"""
PROBLEM = "(define (problem x) (:domain d) (:init (= (f) 0)) (:goal (and)))"
HEAD = "parameter k default 1; durative-action instance i : (a);"
FLEXIBLE = f"{HEAD} c: i.start - .zero in [k, inf]; c: i.end - i.start in [1, 1]; c: i.end - .zero in [-inf, 4];"
TWO = (
    "parameter k default 1; parameter n default 2; durative-action instance i : (a);"
    "c: i.start - .zero in [k, n]; c: i.end - i.start in [1, 1];"
)


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
@pytest.mark.parametrize(
    ("condition", "plan", "box"),
    [
        ("()", FLEXIBLE, "k ∈ (-inf, 3]"),
        ("()", TWO, None),
        ("(at end (<= (f) 1))", FLEXIBLE, "k ∈ (-inf, 3]"),
        ("(over all (< (f) 2))", FLEXIBLE, "k ∈ (-inf, 3]"),
    ],
)
def test_small_plans(condition, plan, box, solver) -> None:
    """Infinite ends, faces where schedules end, and schedules that have to move with the parameters."""
    texts = Texts(SMALL.format(condition), PROBLEM, plan)
    ours, ground = tools.assembled(texts), reader.ground(*texts)
    widest = envelope(ours).box
    assert box in (None, str(widest))
    encoding = create_encoding("relational", ours)
    lines = [*good_lines(ground, tools.EPSILON, widest, solver=solver, deadline=Deadline.after(60))]
    faces = [*face_lines(ground, encoding, widest, solver=solver, deadline=Deadline.after(60))]
    assert any(line[0] == "cycle" for line in faces)
    claim = tools.judged([header("maximal", widest), *lines, *faces], ground)
    assert not isinstance(claim, str), claim
    assert "no other valid box" in claim.text
    found = region_lines(ground, tools.EPSILON, region(ours).region, deadline=Deadline.after(60))
    assert not isinstance(tools.judged([header("region"), *found], ground), str)


def test_schedules_that_move_with_the_parameters() -> None:
    """No constant times suit the box, affine ones do; a corner without any is said."""
    texts = Texts(SMALL.format("()"), PROBLEM, TWO.replace("[k, n]", "[k, k]") + "c: .zero - i.end in [-inf, n];")
    formulas = Formulas(reader.ground(*texts), tools.EPSILON)
    ranges = {"k": (Fraction(0), Fraction(5)), "n": (Fraction(2), Fraction(2))}
    box = Box({name: Interval(*ends) for name, ends in ranges.items()})
    tied = constant_times(formulas, ranges)
    assert tied == {"@0": {}} or tied is not None  # the start is tied to k
    texts = Texts(
        SMALL.format("()"), PROBLEM, FLEXIBLE.replace("[k, inf]", "[k, 3]").replace("default 1;", "default 1;")
    )
    texts = texts._replace(plan=texts.plan + "c: i.start - .zero in [-inf, k];")
    formulas = Formulas(reader.ground(*texts), tools.EPSILON)
    facts = box_facts(Box({"k": Interval(Fraction(0), Fraction(3))}))
    assert affine_times(formulas, facts, solver="z3", deadline=Deadline.after(60)) is not None
    assert box.intervals
    with pytest.raises(RefutedError, match="allows no schedule"):
        good(reader.ground(*texts), Box({"k": Interval(Fraction(4), Fraction(5))}))


def test_orders_and_circles_of_a_network() -> None:
    ground = reader.ground(SMALL.format("()"), PROBLEM, FLEXIBLE)
    orders = OrderLemmas(ground, {"k": (Fraction(2), Fraction(3))})
    assert [orders.get((0, 2)), orders.get((0, 1)), orders.get((2, 1)), orders.get((1, 1), 7)] == [3, 2, None, 7]
    lemmas = {(a, b): (path, bound) for a, b, path, bound, _ in orders.lemmas()}
    assert lemmas.keys() == {(0, 1), (0, 2)}
    assert positive_circle(ground, {"k": Fraction(3)}) is None
    circle = positive_circle(ground, {"k": Fraction(7, 2)})
    assert circle is not None
    assert {ground.edges[number][:2] for number in circle} == {(0, 1), (1, 2), (2, 0)}


def test_what_is_not_true_has_no_certificate() -> None:
    box = envelope(load_plan(*tools.NAVIGATION)).box
    wider = box.replace("to_ridge", Interval(Fraction(25), Fraction(37)))
    with pytest.raises(RefutedError, match="found a schedule that breaks"):
        tools.made(tools.NAVIGATION, "box", box=wider)
    smaller = box.replace("to_ridge", Interval(Fraction(26), Fraction(36)))
    with pytest.raises(UnsupportedError, match="can be moved"):
        tools.made(tools.NAVIGATION, "maximal", box=smaller)
    ground, plan = tools.grounded(tools.NAVIGATION), load_plan(*tools.NAVIGATION)
    exact = region(plan).region
    with pytest.raises(RefutedError):
        region_lines(ground, tools.EPSILON, exact.universe(exact.parameters), deadline=Deadline.after(60))
    with pytest.raises(UnsupportedError):
        region_lines(ground, tools.EPSILON, exact.nothing(exact.parameters), deadline=Deadline.after(60))


def test_a_construct_that_the_checker_does_not_know(tmp_path) -> None:
    texts = Texts(SMALL.format("()"), PROBLEM, FLEXIBLE)
    files = tools.written(texts, tmp_path)
    plan = load_plan(*files)
    files[0].write_text(texts.domain.replace("(:functions (f))", "(:functions (f)) (:event x)"), encoding="utf-8")
    with pytest.raises(UnsupportedError, match="the checker of certificates does not read this"):
        PlanCertificate(files, plan)


def test_epsilon_zero_and_conditions_of_one_name(tmp_path) -> None:
    """Two conditions of one action that look alike; separations that are none."""
    condition = "(and (at end (>= ?duration 1)) (at end (>= ?duration 1)) (at start (>= ?duration 1)))"
    files = tools.written(Texts(SMALL.format(condition), PROBLEM, FLEXIBLE), tmp_path)
    for epsilon in (Fraction(0), Fraction(1, 1000)):
        lines = tools.made(files, "maximal", epsilon=epsilon)
        assert not isinstance(tools.judged(lines, tools.grounded(files), epsilon=epsilon), str)


def test_out_of_time(tmp_path) -> None:
    ground = tools.grounded(tools.NAVIGATION)
    box = Box.nominal(load_plan(*tools.NAVIGATION).parameters)
    with pytest.raises(OutOfTimeError):
        good_lines(ground, tools.EPSILON, box, solver="z3", deadline=Deadline.after(0))
    assert declared_bounds(ground).intervals.keys() == box.intervals.keys()


# -- plans with choices ------------------------------------------------------------------------------------------------


def test_plans_with_choices(tmp_path) -> None:
    """A network has a certificate if and only if the oracle finds no correct execution."""
    seen = set()
    for seed in range(40):
        path = random_plan(seed, 0, Shape(top=4, inner=2)).write(tmp_path / str(seed))
        verdict = Oracle(load_team_plan(path)).decide().verdict
        try:
            lines = knowledge(path, tools.EPSILON, Deadline.after(60))
            code, answer = tools.command(lines, tmp_path / "c", [path])
            assert (code, answer["kind"], verdict) == (0, "knowledge", ExecutionExistence.NONE)
        except RefutedError:
            assert verdict is ExecutionExistence.EXISTS
        seen.add(verdict)
    assert len(seen) == 2


def test_a_certificate_of_another_network(tmp_path) -> None:
    wrong = sat_plan([[1, 2], [-1, 2], [1, -2], [-1, -2]]).write(tmp_path / "wrong")
    right = sat_plan([[1, 2], [-1, 2], [1, -2]]).write(tmp_path / "right")
    lines = knowledge(wrong, tools.EPSILON, Deadline.after(60))
    assert tools.command(lines, tmp_path / "c", [wrong])[0] == 0
    assert tools.ask(tmp_path / "c", [right])[0] == 1
    assert tools.ask(tmp_path / "c", [wrong], kind="plan")[0] == 1
    assert tools.ask(tmp_path / "c", tools.NAVIGATION)[0] == 1
    with pytest.raises(RefutedError):
        knowledge(right, tools.EPSILON, Deadline.after(60))


def test_proofs_by_another_solver(tmp_path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plan = load_plan(*tools.NAVIGATION)
    encoding, box = RelationalEncoding(plan), envelope(plan).box
    assert export(encoding, box, tmp_path / "proofs", Deadline.after(60)) >= 0
    with pytest.raises(OutOfTimeError):
        export(encoding, box, tmp_path, Deadline.after(0))
    wider = box.replace("to_ridge", Interval(Fraction(0), Fraction(100)))
    with pytest.raises(RefutedError, match="found a schedule that breaks"):
        export(encoding, wider, tmp_path, Deadline())
