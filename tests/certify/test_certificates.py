"""Certificates of plans, boxes and regions: the examples, recorded data where it is at hand, and changed ones."""

import random
from fractions import Fraction

import pytest

from benchmarks.suite import read_suite
from robust.api import region
from robust.certify.document import mismatch
from robust.certify.exactness import combined, halved, halves_of, multiples, section, substituted
from robust.certify.ground import GroundPlan
from robust.certify.produce import PlanCertificate, schedule_over
from robust.encode import create_encoding
from robust.errors import RefutedError, RobustError, UnsupportedError
from robust.plan.load import load_plan
from robust.plan.simulate import simulate
from robust.qe.box import Interval
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.smt.limits import Deadline
from tests.certify import tools
from tests.certify.mutations import CASES, ELSEWHERE, REJECTED, TRUE, outcomes, run, table

RECORDED = ("mission_10_0_3", "plan_05_2", "plan_01_3", "plan_g02_w06")
LARGEST = 10_000_000


def recorded(dataset, name):
    """The files of a recorded plan."""
    delivery = dataset / "robot-delivery"
    if (delivery / f"{name}.stn").exists():
        return delivery / "domain.pddl", delivery / f"problem_{name[5:]}.pddl", delivery / f"{name}.stn"
    return next(one.files for one in read_suite(dataset) if one.files[2].stem == name)


by_kind = pytest.mark.parametrize("kind", ["plan", "maximal"])
examples = pytest.mark.parametrize("files", [tools.NAVIGATION, tools.GENERATOR], ids=["navigation", "generator"])


@examples
@by_kind
def test_certificates_are_accepted(files, kind, tmp_path):
    path = tmp_path / "made.cert"
    plan, _ = tools.certificate(files, path, kind=kind)
    given = {name: str(file) for name, file in tools.by_name(files).items()}
    assert (tools.rejection(path, given), mismatch(path, plan, Deadline())) == (None, None)
    assert path.stat().st_size < LARGEST


@pytest.mark.parametrize("name", RECORDED)
@by_kind
def test_certificates_of_recorded_plans_are_accepted(dataset, name, kind, tmp_path):
    test_certificates_are_accepted(recorded(dataset, name), kind, tmp_path)


def test_a_box_that_is_not_valid_has_no_certificate(tmp_path):
    _, box = tools.certificate(tools.GENERATOR, tmp_path / "made.cert", kind="box")
    name = next(iter(box.intervals))
    wider = box.replace(name, Interval(box[name].lower, None, box[name].lower_closed, False))
    with pytest.raises((RefutedError, UnsupportedError)):
        tools.certificate(tools.GENERATOR, tmp_path / "wrong.cert", kind="box", box=wider)


def test_a_certificate_is_not_about_another_plan(tmp_path):
    path = tmp_path / "made.cert"
    tools.certificate(tools.NAVIGATION, path, kind="plan")
    assert "parameters" in mismatch(path, load_plan(*tools.GENERATOR), Deadline())
    lines = tools.lines_of(path)
    place = next(index for index, line in enumerate(lines) if index and line[0] == "constraint")
    for change in ({place: [*lines[place][:3], [[7]]]}, {len(lines) - 1: ["folded", "x"]}):
        tools.write_lines(path, [change.get(index, line) for index, line in enumerate(lines)])
        assert mismatch(path, load_plan(*tools.NAVIGATION), Deadline()) is not None


@examples
def test_schedules_are_ones_that_the_network_allows(files, tmp_path):
    plan, box = tools.certificate(files, tmp_path / "made.cert", kind="box")
    places = schedule_over(GroundPlan(plan), box.ranges)
    source = random.Random(1)
    for _ in range(20):
        values = {}
        for name, each in box.intervals.items():
            low = each.lower if each.lower is not None else Fraction(-5)
            high = each.upper if each.upper is not None else low + 10
            values[name] = low + (high - low) * Fraction(source.randint(1, 9), 10)
        times = {
            point: place.evaluate({unknown: values[str(unknown)] for unknown in place.variables})
            for point, place in zip(plan.time_points, places, strict=True)
        }
        assert not simulate(plan, values, times).network_violations


# -- regions: pieces that are valid, polyhedra outside that are not, and nothing else ---------------------------------


@pytest.fixture(scope="module")
def certified(tmp_path_factory):
    path = tmp_path_factory.mktemp("regions") / "region.cert"
    return *tools.certificate(tools.NAVIGATION, path, kind="region"), path


def test_the_whole_envelope_is_certified(certified):
    plan, found, path = certified
    said = tools.CHECKER.check(str(path), {})
    assert mismatch(path, plan, Deadline()) is None
    assert "established: the network has a schedule in each of the pieces (1)" in said
    assert any("polyhedra outside and the pieces are all parameter values" in line for line in said)
    assert any("those are bad, " in line for line in said)
    assert found.equals(region(plan, backend="fourier-motzkin").region)


def test_what_is_said_to_break_outside_is_compared(certified, tmp_path):
    """The checker holds it against the certificate's own formulas, only the comparison against the encoding's."""
    plan, _, original = certified
    path, lines = tmp_path / "region.cert", tools.lines_of(original)
    x = [place for place, line in enumerate(lines) if place and line[0] == "root" and line[2] == "x"]
    assert len(x) > 1
    for place in x[1:]:
        changed = [*lines[:place], ["root", lines[x[0]][1], *lines[place][2:]], *lines[place + 1 :]]
        tools.write_lines(path, changed)
        assert "is not the encoding's" in mismatch(path, plan, Deadline())


def test_regions_that_are_not_the_envelope_have_no_certificate(certified):
    plan, found, _ = certified
    (piece,) = found.as_union().pieces
    parameter = plan.parameters[0]
    below = LinearConstraint.of({parameter.name: 1}, "<=", parameter.nominal)
    for wrong in (piece.restricted([below]), Polyhedron.universe(piece.parameters)):
        made = PlanCertificate(create_encoding("relational", plan), kind="region", inputs={})
        with pytest.raises(RobustError):
            made.add_region(Region.union_of(piece.parameters, [wrong]))


ONE = Fraction(1)
SQUARE = [({"x": ONE}, False), ({"x": -ONE, "": ONE}, True), ({"y": ONE}, False), ({"y": -ONE, "": ONE}, False)]


def test_affine_sections():
    between = [({"t": ONE, "x": -ONE}, False), ({"y": ONE, "x": ONE, "t": -ONE, "": ONE}, True)]
    found = section(["t"], ["x", "y"], SQUARE, between, solver="z3", deadline=Deadline())
    for form, _ in between:
        value = substituted(form, found)
        rest = value
        for index, factor in multiples(SQUARE, value):
            assert factor > 0
            rest = combined(rest, SQUARE[index][0], -factor)
        assert rest.keys() <= {""}
        assert rest.get("", 0) >= 0
    wedge = [({"t": ONE, "x": -ONE}, False), ({"t": -ONE, "x": ONE, "": Fraction(-1)}, False)]
    assert section(["t"], ["x", "y"], SQUARE, wedge, solver="z3", deadline=Deadline()) is None


def test_forms_that_may_be_negative_have_no_multiples():
    with pytest.raises(ValueError, match="negative somewhere"):
        multiples(SQUARE, {"x": ONE, "": Fraction(-1, 2)})


def test_halves_cover_the_whole():
    ends = (LinearConstraint.of({"x": 1}, ">=", 0), LinearConstraint.of({"y": 1}, "<=", 3))
    whole = Polyhedron(("x", "y"), ends)
    for turn in range(6):
        below, above = halved(whole, turn)
        assert below.is_disjoint_from(above)
        assert Region.union_of(whole.parameters, (below, above)).equals(Region.union_of(whole.parameters, (whole,)))
    assert len(halves_of(Polyhedron(("x",), (LinearConstraint.of({"x": 1}, "=", 2),)))) == 2


# -- changed certificates: each is rejected, or still establishes something true --------------------------------------


@pytest.mark.parametrize("case", CASES)
def test_changed_certificates_are_rejected_or_true(case, tmp_path):
    made = CASES[case](tmp_path / "original.cert")
    found = outcomes(tmp_path / "original.cert", *made, count=100, seed=1)
    assert sum(found.values()) == 100
    assert sum(count for (_, outcome), count in found.items() if outcome == REJECTED) > 50


@pytest.mark.slow
def test_ten_thousand_changed_certificates_are_rejected_or_true(tmp_path):
    found = run(10_000, tmp_path, seed=2)
    print(table(found))
    assert sum(found.values()) == 10_000
    assert {outcome for _, outcome in found} == {REJECTED, ELSEWHERE, TRUE}
    assert all(found[way, REJECTED] for way, _ in found)
