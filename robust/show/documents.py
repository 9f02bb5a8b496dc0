"""Documents that `--json` prints, as types: the fields, their meaning, and how results become documents.

The published schemas in `robust/show/schemas` are those of these types. An object that `--json` prints names
itself in `schema`, the tag of its type. What a result holds is itself where JSON says the same; records are
declared only for what differs. Probabilities are decimals that are rounded outwards, so that they hold as printed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import singledispatch
from math import floor
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from msgspec import UNSET, Meta, UnsetType

from robust import backends, errors
from robust.json_text import Count, End, JsonObject, Rational, Seconds, like, on_wire, one_of, printed, wire
from robust.numbers import exact_end
from robust.qe.box import Box, Interval

if TYPE_CHECKING:
    from robust.irr.quantities import QuantityChange
    from robust.probability.measure import Bounds

DIGITS = 9
"""Decimals of probabilities in JSON, rounded outwards."""


def decimal(value: Fraction, places: int, *, up: bool) -> str:
    """A probability as a decimal, rounded up or down."""
    scaled = value * 10**places
    integer = -floor(-scaled) if up else floor(scaled)
    return f"{integer // 10**places}.{integer % 10**places:0{places}d}"


def places_for(within: Fraction) -> int:
    """Decimals for people: one more than is asked for."""
    places = 4
    while Fraction(1, 10 ** (places - 1)) > within and places < DIGITS:
        places += 1
    return places


def bounds_text(bounds: Bounds, places: int) -> str:
    """`0.8588 to 0.8590`, rounded outwards; `0.5275` where both are the same."""
    lower, upper = decimal(bounds.lower, places, up=False), decimal(bounds.upper, places, up=True)
    if bounds.width < Fraction(1, 10**DIGITS):
        return f"{float(bounds.lower):.{places}f}"
    return lower if lower == upper else f"{lower} to {upper}"


Probability = Annotated[str, Meta(pattern=r"^[01]\.[0-9]+$", description="a decimal")]


class Range(JsonObject):
    """bounds, rounded outwards: the probability is certainly between them"""

    lower: Probability
    upper: Probability


def range_of(bounds: Bounds) -> Range:
    """Bounds as decimals."""
    return Range(lower=decimal(bounds.lower, DIGITS, up=False), upper=decimal(bounds.upper, DIGITS, up=True))


Document = dict[str, Any]
Solver = Annotated[str, one_of(*backends.SOLVERS)]
Encoding = Annotated[str, one_of(*backends.ENCODINGS)]
Verdict = Annotated[str, one_of("proved", "refuted", "unknown")]
Ended = Annotated[str, one_of("complete", "timeout", "interrupted", "unknown")]
SearchEnded = Annotated[str, one_of("complete", "timeout", "interrupted", "invalid", "unknown")]
Kind = Annotated[str, one_of("weak", "dynamic", "strong")]
Rationals = dict[str, Rational]


def document(record: JsonObject) -> Document:
    """The document of a record."""
    answer: Document = printed(record)
    return answer


def document_of(kind: type[JsonObject], source: object, **fields: Any) -> Document:
    """The document of a record that is like its source, but for some fields."""
    return document(like(kind, source, **fields))


@singledispatch
def documenting(result: object) -> Document:
    """The document of a result, by the type of the result: `documenting.dispatch(type(result))`."""
    raise TypeError(f"found {type(result).__name__}, expected a result that has a document")


class Tabulated(NamedTuple):
    """The place of a result's main table in its document.

    Attributes:
        keys: which lead to it.
        named: what the rows of a table by name are called.
        numbers: the columns that are numbers.
        rows: makes the table of the document, instead.
    """

    keys: tuple[str | int, ...]
    named: str
    numbers: Sequence[str]
    rows: Callable[[Document], list[Document]] | None


@singledispatch
def table_of(result: object) -> Tabulated:
    """The table of a result, by its type."""
    raise errors.InputError(
        f"found {type(result).__name__} without a table, expected a result with one: as_dict() has everything there is"
    )


def has_table(
    kind: type,
    *keys: str | int,
    named: str = "",
    numbers: Sequence[str] = (),
    rows: Callable[[Document], list[Document]] | None = None,
) -> None:
    """Declare the table of results of a type, see :class:`Tabulated`."""
    table = Tabulated(keys, named, numbers, rows)
    table_of.register(kind, lambda _: table)


ENDS = ("lower", "upper")
SIDES = ("nominal", *ENDS, "percent_below", "percent_above")
CHANGE = ("old", "new", "cost")
"""Columns that are numbers."""


class Noted(JsonObject, kw_only=True):
    """An answer about a plan; `notes` are what was done to read it, if anything but reading it was done.

    Attributes:
        notes: what was picked, skipped and moved to read the plan, and where its parameters were found
    """

    notes: list[str] | UnsetType = UNSET


# -- what several of them hold -----------------------------------------------------------------------------------------


class Ends(JsonObject):
    lower: End
    upper: End
    lower_closed: bool
    upper_closed: bool


@wire.register(Interval)
def ends_of(interval: Interval) -> Ends:
    """An infinite end is not closed."""
    return Ends(
        lower=exact_end(interval.lower, upper=False),
        upper=exact_end(interval.upper, upper=True),
        lower_closed=interval.lower is not None and interval.lower_closed,
        upper_closed=interval.upper is not None and interval.upper_closed,
    )


@wire.register(Box)
def _(box: Box) -> dict[str, Ends]:
    return {name: ends_of(interval) for name, interval in box.intervals.items()}


on_wire("Statistics", failures=None)
on_wire("Violation", amount=None, since=None)


class PlanChange(JsonObject):
    """
    Attributes:
        statement: of the plan, as it was written
        line: where it stands, if in a file
        part: which of its numbers changes
        cost: the amount times the weight; null for a bound that was infinite
        words: the change, for people
        serves: the obligations, or statements of the network, that break without the change
    """

    statement: str
    line: int | None
    part: Annotated[str, one_of("lower", "upper", "default")]
    old: End
    new: Rational
    cost: Rational | None
    words: str
    serves: list[str]


def changes_of(changes: Sequence[QuantityChange]) -> list[PlanChange]:
    """Changes of a plan."""
    return [
        like(
            PlanChange,
            change,
            line=change.location.line if change.location is not None else None,
            old=exact_end(change.old, upper=change.part == "upper"),
        )
        for change in changes
    ]


# -- errors ------------------------------------------------------------------------------------------------------------


class Failure(JsonObject):
    """
    Attributes:
        kind: timeout and interrupted: before there was anything to answer
        file: the file or option that the message is about
    """

    kind: Annotated[str, one_of("input", "usage", "unsupported", "solver", "timeout", "interrupted", "internal")]
    message: str
    file: str | None
    line: Annotated[int, Meta(ge=1)] | None
    column: Annotated[int, Meta(ge=1)] | None
    exit_code: Annotated[int, one_of(2, 3, 4)]


class Error(JsonObject, tag_field="schema", tag="robust/error/1"):
    """what any command prints with --json where there is no answer; the message is on stderr as well"""

    error: Failure


def error(error: errors.RobustError, kind: str, exit_code: int) -> Document:
    """There is no answer; `kind` says why."""
    place = {name: getattr(error.location, name, None) for name in ("file", "line", "column")}
    return document(Error(error=Failure(kind=kind, message=error.message, exit_code=exit_code, **place)))


# -- certificates ------------------------------------------------------------------------------------------------------


class Certify(Noted, tag_field="schema", tag="robust/certify/1"):
    """robust certify --json: a certificate that has been written and checked."""

    kind: Annotated[str, one_of("plan", "box", "maximal", "shape", "region", "execution", "knowledge")]
    certificate: str
    bytes: Annotated[int, Meta(ge=1)]
    seconds: Seconds
    checking_s: Seconds
    claim: str
    epsilon: str
    files: dict[str, str]
    obligations: Count
    refuted: Count
    alethe_holes: Count | None


class CheckedBy(JsonObject):
    """What one checker says of a certificate, and what has to be trusted if it establishes something."""

    checker: Annotated[str, one_of("python", "kernel")]
    verdict: Annotated[str, one_of("established", "rejected", "unsupported")]
    reason: str | None
    trusts: str
    seconds: Seconds


class Verify(JsonObject, tag_field="schema", tag="robust/verify/1"):
    """robust verify --json: what a certificate establishes of files with these digests.

    Attributes:
        box: the values of parameters that have been proved
    """

    verdict: Annotated[str, one_of("established", "rejected")]
    kind: str | None
    claim: str | None
    epsilon: str | None
    box: dict[str, Ends] | None
    files: dict[str, str]
    obligations: Count | None
    refuted: Count | None
    reason: str | None
    checkers: list[CheckedBy]
    seconds: Seconds
