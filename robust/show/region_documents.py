"""Regions as JSON: robust region, and the polyhedra and constraints of which all regions consist."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, ClassVar

from msgspec import UNSET, Meta, UnsetType

from robust import backends, numbers
from robust.json_text import Count, JsonObject, Rational, Seconds, one_of
from robust.qe import compute, estimate
from robust.qe.box import Box
from robust.qe.inner import EnvelopeFactor
from robust.show import documents, regions

if TYPE_CHECKING:
    from robust.smt.session import Statistics


class ConstraintRecord(JsonObject):
    """Σ coefficient · parameter, compared with the constant"""

    coefficients: documents.Rationals
    relation: Annotated[str, one_of("<=", "<", "=")]
    constant: Rational


class PolyhedronRecord(JsonObject):
    """
    Attributes:
        constraints: all of them hold; none: everything
    """

    constraints: list[ConstraintRecord]


class Outer(JsonObject):
    """A polyhedron from which others are removed; where rates multiply times that vary, what of it is in one of some"""

    base: list[ConstraintRecord]
    minus: list[PolyhedronRecord]
    polyhedra: list[PolyhedronRecord] | UnsetType = UNSET


class Factor(JsonObject):
    """bounds for the values of an independent group of parameters

    Attributes:
        ascending: lists of interchangeable parameters; a point is asked about with each of them in ascending order, to
            which its values are brought by swaps
        swaps: for each list, how the first of it changes places with each other: pairs that change places together
        outer: no point outside is valid
        inner: points in one of these polyhedra are valid, as to this group; null: all points in `outer` are
    """

    parameters: list[str]
    ascending: list[list[str]]
    swaps: list[list[list[tuple[str, str]]]]
    outer: Outer
    inner: list[PolyhedronRecord] | None


class Lifted(JsonObject):
    """difference constraints between times whose bounds depend on parameters; time zero is left out

    Attributes:
        times: names of times: a point is in the region if and only if some times satisfy all constraints with it
        constraints: over parameters and times
    """

    times: Annotated[list[str], Meta(extra_json_schema={"uniqueItems": True})]
    constraints: list[ConstraintRecord]


class RegionDocument(documents.Noted, tag_field="schema", tag="robust/region/1", kw_only=True):
    """robust region --json: the robustness envelope, or an outer bound of it

    Attributes:
        status: complete: the region is the envelope; otherwise it contains the envelope, and not every point of it is
            valid
        reason: only if unknown: how a solver failed, or which rates multiply times that vary
        meaning: what the region is, in a sentence
        polyhedra: form union: the region is their union
        base: form difference: the polyhedron from which others are removed
        minus: form difference: what is removed
        lifted: where one order is left, with more than a few parameters: the envelope as difference constraints; form
            lifted: there are too many inequalities without times
        box: only if cut short, and if found: all values in it are valid
        pieces: polyhedra of bad parameter values that were found
        factors: the same for independent groups of parameters and up to permutations, with inner bounds; a point is
            valid if it is so as to every group; empty if that says no more than the region, or nothing is known
        open_share: null if complete, or not known
    """

    RULES: ClassVar[documents.Document] = {
        "oneOf": [
            {"properties": {"form": {"const": "union"}}, "required": ["polyhedra"]},
            {"properties": {"form": {"const": "difference"}}, "required": ["base", "minus"]},
            {"properties": {"form": {"const": "lifted"}}, "required": ["lifted"]},
        ]
    }

    status: documents.Ended
    reason: str | UnsetType = UNSET
    meaning: str
    parameters: Annotated[list[str], Meta(extra_json_schema={"uniqueItems": True})]
    form: Annotated[str, one_of("union", "difference", "lifted")]
    polyhedra: list[PolyhedronRecord] | UnsetType = UNSET
    base: list[ConstraintRecord] | UnsetType = UNSET
    minus: list[PolyhedronRecord] | UnsetType = UNSET
    lifted: Lifted | UnsetType = UNSET
    box: Box | UnsetType = UNSET
    backend: Annotated[str, one_of(*backends.OFFERED)]
    splitting: Annotated[str, one_of(*backends.SPLITTINGS)]
    learning: bool
    encoding: documents.Encoding
    solver: documents.Solver
    epsilon: Rational
    pieces: Count
    seconds: Seconds
    statistics: Statistics
    factors: list[Factor]
    open_share: estimate.OpenShare | None


def region(result: compute.RegionResult) -> documents.Document:
    """The document of a region in the form in which it is shown."""
    shown = {key: value for key, value in result.region.as_dict().items() if key != "schema"}
    shown["lifted"] = UNSET if result.lifted is None else result.lifted.lifted_dict()
    shown["box"] = UNSET if result.box is None else result.box
    shown["reason"] = UNSET if result.reason is None else result.reason
    more = not result.is_exact or len(result.factors) > 1 or any(factor.symmetry for factor in result.factors)
    factors = [_factor(factor) for factor in result.factors] if more else []
    return documents.document_of(RegionDocument, result, factors=factors, **shown)


@documents.documenting.register(compute.RegionResult)
def _(result: compute.RegionResult) -> documents.Document:
    return region(regions.formed(result))


def _factor(factor: EnvelopeFactor) -> Factor:
    outer, proved = factor.outer.as_dict(), factor.inner.as_dict()
    return Factor(
        parameters=list(factor.parameters),
        ascending=[list(names) for names in factor.symmetry.classes],
        swaps=[[list(swap) for swap in swaps] for swaps in factor.symmetry.swaps],
        outer=Outer(base=outer.get("base", []), minus=outer.get("minus", []), polyhedra=outer.get("polyhedra", UNSET)),
        inner=proved.get("polyhedra"),
    )


def constraint_rows(region: documents.Document) -> list[documents.Document]:
    """The constraints of a region, with the number of the piece that each belongs to, and whether that is removed."""
    if region["form"] == "lifted":
        known = region["lifted"]
        labeled = [({"piece": 0, "removed": False}, known["constraints"])]
        return rows_of(labeled, [*region["parameters"], *known["times"]])
    base = [{"constraints": region["base"]}] if region["form"] == "difference" else region["polyhedra"]
    pieces = [*((False, piece) for piece in base), *((True, piece) for piece in region.get("minus", ()))]
    labeled = [
        ({"piece": number, "removed": removed}, piece["constraints"]) for number, (removed, piece) in enumerate(pieces)
    ]
    return rows_of(labeled, region["parameters"])


documents.has_table(compute.RegionResult, rows=constraint_rows)


def rows_of(
    pieces: Iterable[tuple[documents.Document, Sequence[documents.Document]]], parameters: Iterable[str]
) -> list[documents.Document]:
    """A row for each constraint of pieces: what is said of the piece, the coefficients by parameter, and the rest."""
    return [
        {
            **label,
            **{name: numbers.approximate(Fraction(constraint["coefficients"].get(name, 0))) for name in parameters},
            "relation": constraint["relation"],
            "constant": numbers.approximate(Fraction(constraint["constant"])),
        }
        for label, constraints in pieces
        for constraint in constraints
    ]
