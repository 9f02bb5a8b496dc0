"""Regions: pieces that are valid, polyhedra outside that are not, and nothing else."""

from fractions import Fraction

import pytest

from robust.api import region
from robust.certify.document import mismatch
from robust.certify.exactness import combined, halved, halves_of, multiples, section, substituted
from robust.certify.produce import PlanCertificate
from robust.encode import create_encoding
from robust.errors import RobustError
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.smt.limits import Deadline
from tests.certify import tools

ONE = Fraction(1)
SQUARE = [({"x": ONE}, False), ({"x": -ONE, "": ONE}, True), ({"y": ONE}, False), ({"y": -ONE, "": ONE}, False)]


@pytest.fixture(scope="module")
def certified(tmp_path_factory):
    path = tmp_path_factory.mktemp("regions") / "region.cert"
    plan, found = tools.region_certificate(tools.NAVIGATION, path)
    return plan, found, path


def test_the_whole_envelope_is_certified(certified):
    plan, _, path = certified
    said = tools.CHECKER.check(str(path), {})
    assert mismatch(path, plan, Deadline()) is None
    assert "established: the network has a schedule in each of the pieces (1)" in said
    assert any("polyhedra outside and the pieces are all parameter values" in line for line in said)
    assert any("those are bad, " in line for line in said)


@pytest.mark.parametrize("kind", ["piece", "outside", "rest", "schedule", "obligation"])
def test_nothing_of_it_may_be_missing(certified, tmp_path, kind):
    *_, original = certified
    lines = tools.lines_of(original)
    path = tmp_path / "shorter.cert"
    ends = ("piece", "outside", "rest", "end") if kind in ("piece", "outside", "rest") else ()
    for place in [index for index, line in enumerate(lines) if index and line[0] == kind]:
        end = place + 1
        while lines[end][0] not in ends and kind != "schedule" and lines[end - 1][0] != "qed":
            end += 1
        kept = [line for line in lines[place:end] if line[0] in ("a", "g", "lemma")]
        tools.write_lines(path, [*lines[:place], *kept, *lines[end:]])
        assert tools.rejection(path) is not None


def test_regions_that_are_not_the_envelope_have_no_certificate(certified):
    plan, found, _ = certified
    (piece,) = found.as_union().pieces
    name = plan.parameters[0].name
    nominal = plan.parameters[0].nominal
    smaller = Polyhedron(piece.parameters, (*piece.constraints, LinearConstraint.of({name: 1}, "<=", nominal)))
    larger = Polyhedron.universe(piece.parameters)
    for wrong in (smaller, larger):
        made = PlanCertificate(create_encoding("relational", plan), kind="region", inputs={})
        with pytest.raises(RobustError):
            made.add_region(Region.union_of(piece.parameters, [wrong]))


def test_the_region_is_the_one_of_elimination(certified):
    plan, found, _ = certified
    assert found.equals(region(plan, backend="fourier-motzkin").region)


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
