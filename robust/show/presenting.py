"""Presentation of each kind of result: `str`, notebooks, `as_dict` and `rows`.

What shows a result is loaded when it is shown, and registers its functions then. Commands print by the same functions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from importlib import import_module
from io import StringIO
from typing import TYPE_CHECKING, Any

from robust.numbers import approximate
from robust.show.console import Console, console, printing

if TYPE_CHECKING:
    from robust.presented import Presented
    from robust.show.documents import Document

SCREEN = 40
"""Lines of a text at most."""
_COLUMNS = 100
_SHOWN_BY: Mapping[str, tuple[str, str]] = {
    "irr.check": ("text", "plan_documents"),
    "irr.search": ("regions", "plan_documents"),
    "irr.compare": ("regions", "plan_documents"),
    "irr.repair": ("repairs", "repairs"),
    "qe.compute": ("regions", "region_documents"),
    "probability.risk": ("risk", "risk"),
    "execute.learned": ("batch", "batch"),
    "execute.validate": ("validation", "validation"),
    "execute.convert": ("execution", "execution"),
    "execute.monitor": ("execution", "execution"),
    "sweeps.batch": ("batch", "batch"),
    "sweeps.rank": ("batch", "batch"),
    "stnu.verdicts": ("stnu", "stnu"),
    "pike_bridge.compile": ("pike", "pike"),
    "pike_bridge.cross_check": ("pike", "pike"),
    "pike_bridge.likelihood": ("pike", "pike"),
    "pike_bridge.online.executive": ("pike", "pike"),
    "pike_bridge.online.world": ("pike_runs", "pike_runs"),
    "pike_bridge.game.controllability": ("pike_games", "pike_games"),
    "pike_bridge.envelopes.search": ("pike_envelopes", "pike_envelopes"),
}
"""By where a result is declared: the module of this folder that prints it, and the one that makes its document."""


def _load(result: object, which: int) -> type:
    """Load what shows a result; its type."""
    for kind in type(result).__mro__:
        if modules := _SHOWN_BY.get(kind.__module__.removeprefix("robust.")):
            import_module(f"{__package__}.{modules[which]}")
            break
    return type(result)


def print_result(out: Console, result: object, *, quiet: bool = False) -> None:
    """Print a result as its command does."""
    printing.dispatch(_load(result, 0))(out, result, quiet=quiet)


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
    from robust.show.tables import Page  # noqa: PLC0415 - rich takes long to load

    out = Page(_COLUMNS)
    print_result(out, result)
    return out.html()


def document(result: Presented) -> Document:
    """The document that `--json` prints."""
    from robust.show.documents import documenting  # noqa: PLC0415 - for JSON only

    return documenting.dispatch(_load(result, 1))(result)


def rows(result: Presented) -> list[dict[str, Any]]:
    """The main table of the document.

    Raises:
        InputError: if there is none.
    """
    from robust.show.documents import table_of  # noqa: PLC0415 - as above

    answer = document(result)
    table = table_of(result)
    content: Any = answer if table.rows is None else table.rows(answer)
    for key in table.keys:
        content = content[key]
    if isinstance(content, dict):
        content = [{table.named: name, **row} for name, row in content.items()]
    return [dict(_cells(row, table.numbers)) for row in content or ()]


def _cells(row: Mapping[str, Any], numbers: Sequence[str], before: str = "") -> Iterator[tuple[str, Any]]:
    """The cells of a row; the fields of an object in it by their own names, behind that of the object."""
    for name, value in row.items():
        if isinstance(value, dict):
            yield from _cells(value, numbers, f"{before}{name}_")
        elif not (isinstance(value, list) and any(isinstance(item, dict) for item in value)):  # a table of its own
            yield f"{before}{name}", _number(value) if name in numbers and isinstance(value, str) else value


def _number(value: str) -> float:
    """The float that is nearest to a rational, and the infinite ones."""
    return float(value) if value in {"inf", "-inf"} else approximate(Fraction(value))
