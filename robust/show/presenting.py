"""How each kind of result is shown: the one table behind `str`, notebooks, `as_dict` and `rows`.

What shows a result is loaded when it is shown. Commands print by the same functions.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from importlib import import_module
from io import StringIO
from typing import TYPE_CHECKING, Any, NamedTuple

from rich.console import Console

from robust.errors import InputError
from robust.numbers import approximate
from robust.show.console import Page, console

if TYPE_CHECKING:
    from robust.presented import Presented
    from robust.show.documents import Document

SCREEN = 40
"""Lines of a text at most."""
_COLUMNS = 100


class Shown(NamedTuple):
    """What shows one kind of result, as `module:function` in this package.

    Attributes:
        noun: for messages.
        document: result to JSON.
        text: prints a result to a console, more or less `quiet`.
        table: where in the document the main table is, key by key, or what makes one of the document.
        named: what the rows of a table by name are called.
        numbers: the columns of it that are numbers.
    """

    noun: str
    document: str
    text: str
    table: str | None = None
    named: str = ""
    numbers: tuple[str, ...] = ()


_ENDS = ("lower", "upper")
_SIDES = ("nominal", *_ENDS, "percent_below", "percent_above")
_CHANGE = ("old", "new", "cost")
_RESULTS: Mapping[str, Shown] = {
    "irr.check:CheckResult": Shown("a verdict", "documents:check", "text:print_check", "obligations"),
    "irr.search:EnvelopeResult": Shown(
        "a box",
        "documents:envelope",
        "envelopes:print_envelope",
        "parameters",
        named="parameter",
        numbers=_SIDES,
    ),
    "qe.compute:RegionResult": Shown(
        "a region",
        "region_documents:formed_region",
        "regions:print_formed",
        "region_documents:constraint_rows",
    ),
    "irr.compare:Comparison": Shown(
        "a comparison",
        "region_documents:compare",
        "regions:print_comparison",
        "boxes",
        numbers=_ENDS,
    ),
    "irr.repair:Repair": Shown(
        "a repair", "repairs:repair_document", "repairs:print_repair", "changes", numbers=_CHANGE
    ),
    "probability.risk:RiskResult": Shown(
        "a probability",
        "risk:answer",
        "risk:print_risk",
        "by_obligation",
        numbers=_ENDS,
    ),
    "execute.validate:Verdict": Shown(
        "a verdict", "validation:one", "validation:print_one", "plans/0/violations", numbers=("time", "amount")
    ),
    "execute.convert:Conversion": Shown(
        "a conversion", "made:converted", "made:print_conversion", "tightened", numbers=("lower", "own")
    ),
    "sweeps.batch:Batch": Shown(
        "a batch", "batch:batch", "batch:print_batch", "plans", numbers=(*_ENDS, "volume_ratio", "width_ratio")
    ),
    "stnu.verdicts:NetworkCheck": Shown(
        "a verdict", "stnu:one_check", "stnu:print_one_check", "results/0/cycle", numbers=("value",)
    ),
    "stnu.verdicts:DispatchResult": Shown(
        "a network", "stnu:one_dispatch", "stnu:print_one_dispatch", "results/0/requirements", numbers=("bound",)
    ),
    "stnu.repairs:NetworkRepair": Shown(
        "a repair", "stnu:one_repair", "stnu:print_one_repair", "results/0/changes", numbers=_CHANGE
    ),
    "pike_bridge.compile:PikeCheck": Shown("a verdict", "pike:check_document", "pike:print_check", "scenarios"),
    "pike_bridge.compile:Sizes": Shown("a compilation", "pike:compile_document", "pike:print_sizes"),
    "pike_bridge.cross_check:Crossed": Shown(
        "a cross-check", "pike:cross_document", "pike:print_cross", "disagreements"
    ),
    "pike_bridge.online.executive:Moments": Shown(
        "what people may choose", "pike:patience_document", "pike:print_patience", "moments", numbers=("latest",)
    ),
    "pike_bridge.online.world:ExecutionRecord": Shown(
        "an execution", "pike:run_document", "pike:print_run", "steps", numbers=("time",)
    ),
    "pike_bridge.envelopes.search:LabeledRegion": Shown(
        "a region",
        "pike_envelopes:whole_region_document",
        "pike_envelopes:print_region",
        "pike_envelopes:possible_rows",
    ),
    "pike_bridge.envelopes.search:TeamEnvelope": Shown(
        "a box",
        "pike_envelopes:envelope_document",
        "pike_envelopes:print_envelope",
        "parameters",
        named="parameter",
        numbers=_SIDES,
    ),
}
"""By where the result is declared."""


def _shown(kind: type) -> Shown:
    names = (f"{one.__module__}:{one.__name__}".removeprefix("robust.") for one in kind.__mro__)
    return next(_RESULTS[name] for name in names if name in _RESULTS)


def noun(kind: type) -> str:
    """What messages call results of that type."""
    return _shown(kind).noun


def _function(name: str) -> Any:
    module, function = name.split(":")
    return getattr(import_module(f"robust.show.{module}"), function)


def print_result(out: Console, result: object, *, quiet: bool = False) -> None:
    """Print a result as its command does."""
    _function(_shown(type(result)).text)(out, result, quiet=quiet)


def text(result: Presented) -> str:
    """A screen of plain text."""
    written = StringIO()
    print_result(console(written, "never", _COLUMNS), result)
    lines = written.getvalue().rstrip("\n").split("\n")
    if len(lines) > SCREEN:
        rest = len(lines) - SCREEN + 1
        lines[SCREEN - 1 :] = [f"... and {rest} more lines; as_dict() has everything"]
    return "\n".join(lines)


def page(result: Presented) -> str:
    """A piece of HTML."""
    out = Page(_COLUMNS)
    print_result(out, result)
    return out.html()


def document(result: Presented) -> Document:
    """What is printed by `--json`."""
    found: Document = json.loads(json.dumps(_function(_shown(type(result)).document)(result)))  # lists, and no tuples
    return found


def rows(result: Presented) -> list[dict[str, Any]]:
    """The main table of the document."""
    shown = _shown(type(result))
    found = None if shown.table is None else _at(document(result), shown.table)
    if found is None:
        raise InputError(f"found {shown.noun} without a table, expected one with: as_dict() has everything there is")
    whole = [{shown.named: name, **row} for name, row in found.items()] if isinstance(found, dict) else found
    return [dict(_cells(row, shown.numbers)) for row in whole]


def _at(whole: Document, place: str) -> Any:
    """What is at a place of a document."""
    if ":" in place:
        return _function(place)(whole)
    found: Any = whole
    for key in place.split("/"):
        found = found[int(key)] if isinstance(found, list) else found.get(key)
    return found


def _cells(row: Mapping[str, Any], numbers: Sequence[str], before: str = "") -> Iterator[tuple[str, Any]]:
    """What is in a row; the fields of an object in it by their own names, behind that of the object."""
    for name, value in row.items():
        if isinstance(value, dict):
            yield from _cells(value, numbers, f"{before}{name}_")
        elif not (isinstance(value, list) and any(isinstance(one, dict) for one in value)):  # a table of its own
            yield f"{before}{name}", number(value) if name in numbers and isinstance(value, str) else value


def number(value: str) -> float:
    """The float that is nearest to a rational, and the infinite ones."""
    return float(value) if value in {"inf", "-inf"} else approximate(Fraction(value))
