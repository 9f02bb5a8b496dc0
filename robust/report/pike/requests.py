"""What the commands on plans with choices have in common: assumptions, and a run that may be given up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import shorten
from robust.report.guard import GivenUpError, Guard
from robust.report.progress import Display

Result = TypeVar("Result")


def assumptions(texts: Sequence[str]) -> dict[str, str]:
    """`NAME=VALUE`, each choice at most once.

    Raises:
        InputError: for any other text, and for two different values of one choice.
    """
    found: dict[str, str] = {}
    for text in texts:
        place = Location(f"--assume {shorten(text)}")
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name or not value:
            raise InputError(f"found {shorten(text)}, expected NAME=VALUE", place)
        if found.setdefault(name, value) != value:
            raise InputError(f"found a second value for {shorten(name)}, expected one", place)
    return found


def check_backend(name: str) -> None:
    """InputError unless an executive can reason with the back end."""
    from robust.pike_bridge.online.reasoners import reasoner_names  # noqa: PLC0415 - imports graphs

    known = reasoner_names()
    if name not in known:
        suggestion = did_you_mean(name, known)
        raise InputError(f"found unknown back end {shorten(name)}{suggestion}", Location("--backend"))


def guarded(  # noqa: PLR0917 (all that a run is made of)
    guard: Guard,
    limit: float | None,
    display: Display,
    work: Callable[[], Result],
    known: Callable[[], Result | None],
    show: Callable[[Result], None],
) -> Result:
    """What the work returns, or what is known when Ctrl-C or the time limit ends it.

    Raises:
        GivenUpError: if nothing is known yet.
    """

    def on_stuck() -> bool:
        display.stop()
        result = known()
        if result is not None:
            show(result)
        return result is not None

    try:
        with guard.working(limit, on_stuck):
            return work()
    except KeyboardInterrupt:
        result = known()
        if result is None:
            raise GivenUpError from None
        return result
