"""Certificates of every kind: made, accepted by the checker, and only for what is true."""

from __future__ import annotations

from fractions import Fraction

import pytest

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
from robust.plan.load import load_plan
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline, OutOfTimeError
from tests.certify import tools
from tests.certify.meaning import meaningless
from tests.certify.texts import Texts, random_texts
from tests.pike_bridge.satisfiability import sat_plan


def soon():
    return Deadline.after(60)


def good(ground, box, solver="z3"):
    return good_lines(ground, tools.EPSILON, box, solver=solver, deadline=soon())


def assert_all_is_certified(plan, ground, solver="z3"):
    """The widest box and the region have certificates; the claim of the box, and the lines of its faces."""
    box = envelope(plan).box
    faces = [*face_lines(ground, create_encoding("relational", plan), box, solver=solver, deadline=soon())]
    claim = tools.judged([header("maximal", box), *good(ground, box, solver), *faces], ground)
    assert not isinstance(claim, str), claim
    assert_region_is_certified(plan, ground)
    return claim, faces


def assert_region_is_certified(plan, ground):
    lines = region_lines(ground, tools.EPSILON, region(plan).region, deadline=soon())
    assert not isinstance(tools.judged([header("region"), *lines], ground), str)


def assert_certified(files, *kinds) -> None:
    for kind in kinds:
        claim = tools.judged(tools.made(files, kind), tools.grounded(files))
        assert not isinstance(claim, str), (files, kind, claim)
        assert (claim.kind, claim.epsilon) == (kind, tools.EPSILON)


@pytest.mark.parametrize("files", [tools.NAVIGATION, tools.GENERATOR], ids=["navigation", "generator"])
def test_examples(files) -> None:
    assert_certified(files, "plan", "box", "maximal", "region")


def test_recorded_plans(dataset) -> None:
    """One of each family; all are certified by `python -m benchmarks.certificates`."""
    recorded = {one.name: one.files for one in read_suite(dataset)}
    recorded |= {one.instance: files for one, files in read_deliveries(dataset)}
    for name in ("auv_mission_10_0_3", "generator_linear_05_2", "solar_rover_01_3", "delivery_g02_w06"):
        assert_certified(recorded[name], "plan", "maximal")
    for name in ("generator_linear_05_2", "solar_rover_01_2"):
        assert_certified(recorded[name], "region")


@pytest.mark.parametrize("first", range(0, 60, 20))
def test_random_plans(first) -> None:
    """A plan has a certificate if and only if it is valid; so have its widest box and its region."""
    done = 0
    for seed in range(first, first + 20):
        texts = random_texts(seed, easy=True)
        try:
            plan, ground = tools.assembled(texts), reader.ground(*texts)
            proved = check(plan).answer.name == "PROVED"
        except (InputError, UnsupportedError, reader.Unsupported):
            continue
        if meaningless(tools.CHECKER, texts):
            continue
        if proved:
            lines = [header("plan"), *good(ground, Box.nominal(plan.parameters))]
            assert not isinstance(tools.judged(lines, ground), str)
        else:
            with pytest.raises(RefutedError):
                good(ground, Box.nominal(plan.parameters))
        if plan.parameters:
            (assert_all_is_certified if proved else assert_region_is_certified)(plan, ground)
        done += 1
    assert done > 8


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


def small(condition="()", plan=FLEXIBLE):
    return Texts(SMALL.format(condition), PROBLEM, plan)


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
    texts = small(condition, plan)
    ours = tools.assembled(texts)
    assert box in (None, str(envelope(ours).box))
    claim, faces = assert_all_is_certified(ours, reader.ground(*texts), solver)
    assert any(line[0] == "cycle" for line in faces)
    assert "no other valid box" in claim.text


def test_schedules_that_move_with_the_parameters() -> None:
    """No constant times suit the box, affine ones do; a corner without any is said."""
    tied = small(plan=TWO.replace("[k, n]", "[k, k]") + "c: .zero - i.end in [-inf, n];")
    ranges = {"k": (Fraction(0), Fraction(5)), "n": (Fraction(2), Fraction(2))}
    assert constant_times(Formulas(reader.ground(*tied), tools.EPSILON), ranges) is not None  # the start is tied to k
    bound = FLEXIBLE.replace("[k, inf]", "[k, 3]") + "c: i.start - .zero in [-inf, k];"
    ground = reader.ground(*small(plan=bound))
    facts = box_facts(Box({"k": Interval(Fraction(0), Fraction(3))}))
    assert affine_times(Formulas(ground, tools.EPSILON), facts, solver="z3", deadline=soon()) is not None
    with pytest.raises(RefutedError, match="allows no schedule"):
        good(ground, Box({"k": Interval(Fraction(4), Fraction(5))}))


def test_orders_and_circles_of_a_network() -> None:
    ground = reader.ground(*small())
    orders = OrderLemmas(ground, {"k": (Fraction(2), Fraction(3))})
    assert [orders.get((0, 2)), orders.get((0, 1)), orders.get((2, 1)), orders.get((1, 1), 7)] == [3, 2, None, 7]
    lemmas = {(a, b): (path, bound) for a, b, path, bound, _ in orders.lemmas()}
    assert lemmas.keys() == {(0, 1), (0, 2)}
    assert positive_circle(ground, {"k": Fraction(3)}) is None
    circle = positive_circle(ground, {"k": Fraction(7, 2)})
    assert circle is not None
    assert {ground.edges[number][:2] for number in circle} == {(0, 1), (1, 2), (2, 0)}


def test_what_is_not_true_has_no_certificate() -> None:
    plan, ground = load_plan(*tools.NAVIGATION), tools.grounded(tools.NAVIGATION)
    box, exact = envelope(plan).box, region(plan).region
    with pytest.raises(RefutedError, match="found a schedule that breaks"):
        good(ground, box.replace("to_ridge", Interval(Fraction(25), Fraction(37))))
    smaller = box.replace("to_ridge", Interval(Fraction(26), Fraction(36)))
    with pytest.raises(UnsupportedError, match="can be moved"):
        tools.made(tools.NAVIGATION, "maximal", box=smaller)
    for wrong, error in ((exact.universe, RefutedError), (exact.nothing, UnsupportedError)):
        with pytest.raises(error):
            region_lines(ground, tools.EPSILON, wrong(exact.parameters), deadline=soon())
    with pytest.raises(OutOfTimeError):
        good_lines(ground, tools.EPSILON, box, solver="z3", deadline=Deadline.after(0))
    assert declared_bounds(ground).intervals.keys() == box.intervals.keys()


def test_a_construct_that_the_checker_does_not_know(tmp_path) -> None:
    files = tools.written(small(), tmp_path)
    plan = load_plan(*files)
    text = files[0].read_text(encoding="utf-8")
    files[0].write_text(text.replace("(:functions (f))", "(:functions (f)) (:event x)"), encoding="utf-8")
    with pytest.raises(UnsupportedError, match="the checker of certificates does not read this"):
        PlanCertificate(files, plan)


@pytest.mark.parametrize("epsilon", [Fraction(0), tools.EPSILON])
def test_epsilon_zero_and_conditions_of_one_name(epsilon, tmp_path) -> None:
    """Two conditions of one action that look alike; separations that are none."""
    condition = "(and (at end (>= ?duration 1)) (at end (>= ?duration 1)) (at start (>= ?duration 1)))"
    files = tools.written(small(condition), tmp_path)
    lines = tools.made(files, "maximal", epsilon=epsilon)
    assert not isinstance(tools.judged(lines, tools.grounded(files), epsilon=epsilon), str)


def test_a_certificate_of_another_network(tmp_path) -> None:
    wrong = sat_plan([[1, 2], [-1, 2], [1, -2], [-1, -2]]).write(tmp_path / "wrong")
    right = sat_plan([[1, 2], [-1, 2], [1, -2]]).write(tmp_path / "right")
    lines = knowledge(wrong, tools.EPSILON, soon())
    assert tools.command(lines, tmp_path / "c", [wrong])[0] == 0
    assert tools.ask(tmp_path / "c", [right])[0] == 1
    assert tools.ask(tmp_path / "c", [wrong], kind="plan")[0] == 1
    assert tools.ask(tmp_path / "c", tools.NAVIGATION)[0] == 1
    with pytest.raises(RefutedError):
        knowledge(right, tools.EPSILON, soon())


@pytest.mark.filterwarnings("ignore")
def test_proofs_by_another_solver(tmp_path) -> None:
    plan = load_plan(*tools.NAVIGATION)
    encoding, box = RelationalEncoding(plan), envelope(plan).box
    assert export(encoding, box, tmp_path / "proofs", soon()) >= 0
    with pytest.raises(OutOfTimeError):
        export(encoding, box, tmp_path, Deadline.after(0))
    wider = box.replace("to_ridge", Interval(Fraction(0), Fraction(100)))
    with pytest.raises(RefutedError, match="found a schedule that breaks"):
        export(encoding, wider, tmp_path, Deadline())
