"""Presentation that every result has: as text, in a notebook, as JSON, as a table and as a picture.

Texts, documents and pictures are those of the command line, loaded when they are asked for, so that a result costs
nothing but itself. No answer is simply true or false: one that is refuted is an answer too.
"""

from __future__ import annotations

import os
from collections.abc import Sequence, Sized
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, Protocol

import robust
from robust.errors import from_extra

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class OneLine:
    """What an interactive session shows as a line; a class to inherit from, without fields.

    Args:
        ask: the attribute that says most, such as what came of a question.
    """

    __slots__ = ()
    _ask: ClassVar[str]

    def __init_subclass__(cls, *, ask: str = "") -> None:
        super().__init_subclass__()
        if ask:
            cls._ask = ask
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = OneLine.__repr__  # type: ignore[method-assign]  # else dataclasses make one of all fields

    def __repr__(self) -> str:
        """A line: the attribute that says most, and how to see the others."""
        others = (name for name in getattr(self, "__dataclass_fields__", ()) if name != self._ask)
        more = "print() shows it" if isinstance(self, Presented) else f"also {', '.join(others)}"
        return f"<{type(self).__name__}: {self._ask} {_in_short(getattr(self, self._ask))}; {more}>"


def _in_short(value: object) -> str:
    if isinstance(value, OneLine):
        return _in_short(getattr(value, value._ask))
    text = repr(value.value if isinstance(value, Enum) else value)
    return text if len(text) < 60 else f"({len(value)})" if isinstance(value, Sized) else "…"


class NoTruthValue(OneLine):
    """An answer without a truth value; the error for asking for one names the attribute that says what it is."""

    __slots__ = ()

    def __bool__(self) -> NoReturn:
        """
        Raises:
            TypeError: always.
        """
        raise TypeError(f"{type(self).__name__} has no truth value: ask .{self._ask}, or whether it `is None`")


class VerdictEnum(Enum):
    """Kinds of answers, none of which has a truth value."""

    def __bool__(self) -> NoReturn:
        """
        Raises:
            TypeError: always.
        """
        raise TypeError(f"{self} has no truth value: ask whether it `is {next(iter(type(self)))}`, or its .value")


class Presenter(Protocol):
    """A presenter of results of every kind."""

    def text(self, result: Presented, /) -> str: ...

    def page(self, result: Presented, /) -> str: ...

    def document(self, result: Presented, /) -> dict[str, Any]: ...

    def rows(self, result: Presented, /) -> list[dict[str, Any]]: ...


class Painter(Protocol):
    """A painter of results of every kind."""

    def draw(self, result: Presented, path: str | os.PathLike[str] | None, axes: str | Sequence[str], /) -> Figure: ...


class Presented(NoTruthValue):
    """A result that can be shown; a class to inherit from, without fields."""

    __slots__ = ()

    def __str__(self) -> str:
        """The text that the command prints: plain, of one screen at most."""
        return robust.presenter().text(self)

    def _repr_html_(self) -> str:
        """The answer as HTML for notebooks, complete and with its tables; texts of files are escaped."""
        return robust.presenter().page(self)

    def as_dict(self) -> dict[str, Any]:
        """The document that `--json` prints: texts, numbers, lists and dictionaries; rationals are texts.

        What only the command knows is as if it was not asked for: the names of files, notes on how they were read, and
        what it found out beside.
        """
        return robust.presenter().document(self)

    def rows(self) -> list[dict[str, Any]]:
        """The main table of the result, a dictionary for each row, as data frames are made of.

        Numbers are the nearest floats, `inf` without limit, and None where there is none; :meth:`as_dict` has exact
        ones.

        Raises:
            InputError: if the result has no table.
        """
        return robust.presenter().rows(self)

    def plot(self, path: str | os.PathLike[str] | None = None, *, axes: str | Sequence[str] = ()) -> Figure:
        """A picture of the result, as a figure of matplotlib.

        Args:
            path: where to write it: .svg, .png or .pdf by suffix; if not given, nothing is written.
            axes: the one or two parameters that are drawn, the others at their nominal values; the first two if not
                given. Boxes of any number of parameters, probabilities and executions are drawn whole.

        Raises:
            InputError: if there is nothing to draw, the file cannot be written, or there is no such parameter.
            UnsupportedError: if matplotlib is not installed.
        """
        try:
            return robust.painter().draw(self, path, axes)
        except ModuleNotFoundError as error:
            raise from_extra(error) or error from error
