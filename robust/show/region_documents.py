"""Answers about regions as JSON: robust region and robust compare."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, ClassVar

from msgspec import UNSET, Meta, UnsetType

from robust.backends import OFFERED, SPLITTINGS
from robust.json_text import Count, End, JsonObject, Rational, Seconds, like, one_of
from robust.numbers import approximate, exact_end
from robust.show.documents import (
    Document,
    Encoding,
    Ended,
    Ends,
    Noted,
    Rationals,
    SearchEnded,
    Solver,
    Statistics,
    box_of,
    document,
    exact,
)
from robust.show.regions import formed

if TYPE_CHECKING:
    from robust.irr import compare as compares
    from robust.qe import inner
    from robust.qe.compute import RegionResult


class Constraint(JsonObject):
    """Σ coefficient · parameter, compared with the constant"""

    coefficients: Rationals
    relation: Annotated[str, one_of("<=", "<", "=")]
    constant: Rational


class Polyhedron(JsonObject):
    """
    Attributes:
        constraints: all of them hold; none: everything
    """

    constraints: list[Constraint]


class Outer(JsonObject):
    """A polyhedron from which others are removed"""

    base: list[Constraint]
    minus: list[Polyhedron]


class Factor(JsonObject):
    """What is known of the values of an independent group of parameters

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
    inner: list[Polyhedron] | None


class OpenShare(JsonObject):
    """How much of a box lies between both bounds

    Attributes:
        value: the share; of random points, if there is a confidence
        lower: at least so much, with the confidence
        upper: at most so much, with the confidence
        confidence: null: exact
        points: how many random points
        box: what it is a share of
    """

    value: Rational
    lower: Rational
    upper: Rational
    confidence: Rational | None
    points: Count | None
    box: dict[str, Ends]


class Region(Noted, tag_field="schema", tag="robust/region/1", kw_only=True):
    """robust region --json: the robustness envelope, or an outer bound of it

    Attributes:
        status: complete: the region is the envelope; otherwise it contains the envelope, and not every point of it is
            valid
        reason: only if unknown: how a solver failed
        meaning: what the region is, in a sentence
        polyhedra: form union: the region is their union
        base: form difference: the polyhedron from which others are removed
        minus: form difference: what is removed
        pieces: polyhedra of bad parameter values that were found
        factors: the same for independent groups of parameters and up to permutations, with inner bounds; a point is
            valid if it is so as to every group; empty if that says no more than the region, or nothing is known
        open_share: null if complete, or not known
    """

    RULES: ClassVar[Document] = {
        "oneOf": [
            {"properties": {"form": {"const": "union"}}, "required": ["polyhedra"]},
            {"properties": {"form": {"const": "difference"}}, "required": ["base", "minus"]},
        ]
    }

    status: Ended
    reason: str | UnsetType = UNSET
    meaning: str
    parameters: Annotated[list[str], Meta(extra_json_schema={"uniqueItems": True})]
    form: Annotated[str, one_of("union", "difference")]
    polyhedra: list[Polyhedron] | UnsetType = UNSET
    base: list[Constraint] | UnsetType = UNSET
    minus: list[Polyhedron] | UnsetType = UNSET
    backend: Annotated[str, one_of(*OFFERED)]
    splitting: Annotated[str, one_of(*SPLITTINGS)]
    learning: bool
    encoding: Encoding
    solver: Solver
    epsilon: Rational
    pieces: Count
    seconds: Seconds
    statistics: Statistics
    factors: list[Factor]
    open_share: OpenShare | None


def formed_region(result: RegionResult) -> Document:
    """Of a region as it was found: in the form in which it is shown."""
    return region(formed(result))


def region(result: RegionResult) -> Document:
    shown = {key: value for key, value in result.region.as_dict().items() if key != "schema"}
    shown["reason"] = UNSET if result.reason is None else result.reason
    more = not result.is_exact or len(result.factors) > 1 or any(one.symmetry for one in result.factors)
    share = result.open_share
    return document(
        like(
            Region,
            result,
            statistics=like(Statistics, result.statistics),
            factors=[_factor(one) for one in result.factors] if more else [],
            open_share=None if share is None else like(OpenShare, share, box=box_of(share.box)),
            **shown,
        )
    )


def _factor(factor: inner.EnvelopeFactor) -> Factor:
    outer, proved = factor.outer.as_dict(), factor.inner.as_dict()
    return Factor(
        parameters=list(factor.parameters),
        ascending=[list(names) for names in factor.symmetry.classes],
        swaps=[[list(swap) for swap in swaps] for swaps in factor.symmetry.swaps],
        outer=Outer(base=outer["base"], minus=outer["minus"]),
        inner=proved.get("polyhedra"),
    )


def constraint_rows(region: Document) -> list[Document]:
    """The constraints of a region, with the number of the piece that each belongs to, and whether that is removed."""
    kept = [region["base"]] if region["form"] == "difference" else [one["constraints"] for one in region["polyhedra"]]
    removed = [one["constraints"] for one in region.get("minus", ())]
    pieces = [*((False, one) for one in kept), *((True, one) for one in removed)]
    labeled = [({"piece": number, "removed": out}, piece) for number, (out, piece) in enumerate(pieces)]
    return rows_of(labeled, region["parameters"])


def rows_of(pieces: Iterable[tuple[Document, Sequence[Document]]], parameters: Iterable[str]) -> list[Document]:
    """A row for each constraint of pieces: what is said of the piece, the coefficients by parameter, and the rest."""
    return [
        {
            **label,
            **{name: approximate(Fraction(one["coefficients"].get(name, 0))) for name in parameters},
            "relation": one["relation"],
            "constant": approximate(Fraction(one["constant"])),
        }
        for label, constraints in pieces
        for one in constraints
    ]


class Volume(JsonObject):
    lower: Rational
    upper: End


class Enumerated(JsonObject):
    status: Ended
    meaning: str
    pieces: Count
    seconds: Seconds
    volume: Volume | None


class Share(JsonObject):
    """a ratio between two certified bounds, exact if they are equal; upper is null if unknown"""

    lower: Rational
    upper: Rational | None


class Witness(JsonObject):
    parameters: Rationals
    obligation: str


class Face(JsonObject):
    """
    Attributes:
        percent: how far it is from the nominal value, in per cent of it; null if that is zero
        gap: how far the face could move outwards alone; an upper bound unless the region is complete
        witness: a point beyond the face, within the gap and 1/1000, and what breaks there
    """

    parameter: str
    side: Annotated[str, one_of("lower", "upper")]
    end: Rational
    percent: Rational | None
    closed: bool
    gap: End
    witness: Witness | None


class ComparedBox(JsonObject):
    method: Annotated[str, one_of("irr", "widen", "optimal", "optimal-nominal")]
    status: SearchEnded
    verified: bool
    reason: str | None
    box: dict[str, Ends]
    volume_ratio: Share | None
    width_ratio: Share | None
    faces: list[Face]
    seconds: Seconds


class Compare(Noted, tag_field="schema", tag="robust/compare/1"):
    """robust compare --json: the exact envelope beside the boxes of all methods

    Attributes:
        parameters: nominal values
    """

    status: SearchEnded
    beta: Rational
    parameters: Rationals
    region: Enumerated | None
    boxes: list[ComparedBox]
    seconds: Seconds


def compare(result: compares.Comparison) -> Document:
    volume = None
    if result.volume is not None:
        volume = Volume(lower=result.volume.lower, upper=exact_end(result.volume.upper, upper=True))
    return document(
        like(
            Compare,
            result,
            parameters=exact({one.name: one.nominal for one in result.plan.parameters}),
            region=None if result.region is None else like(Enumerated, result.region, volume=volume),
            boxes=[_compared(entry) for entry in result.entries],
        )
    )


def _compared(entry: compares.Entry) -> ComparedBox:
    parameters = {one.name: one for one in entry.result.parameters}
    return like(
        ComparedBox,
        entry.result,
        method=entry.method,
        box=box_of(entry.result.box),
        volume_ratio=_share(entry.volume_share),
        width_ratio=_share(entry.width_share),
        faces=[
            like(
                Face,
                face,
                percent=parameters[face.parameter].percent(face.end),
                gap=exact_end(face.gap, upper=True),
                witness=None if face.witness is None else like(Witness, face.witness, parameters=face.witness.values),
            )
            for face in entry.faces
        ],
    )


def _share(share: compares.RatioBounds | None) -> Share | None:
    return None if share is None else like(Share, share)


DOCUMENTS: tuple[type[JsonObject], ...] = (Region, Compare)
"""Every object whose schema is generated, see `tests/show`."""
