"""Functions made from declared options: what a command takes by name, a function takes as keyword arguments."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, TypeVar, cast

from robust.options.declare import Option, Options
from robust.smt.limits import noticing_interrupts

Given = ParamSpec("Given")
Taken = TypeVar("Taken", bound=Options)
Subject = TypeVar("Subject")
Subject_contra = TypeVar("Subject_contra", contravariant=True)
Known = TypeVar("Known")
Result = TypeVar("Result")
Result_co = TypeVar("Result_co", covariant=True)


class WithFirst(Protocol[Subject_contra, Given, Result_co]):
    """A function whose first option may be given by its place."""

    def __call__(
        self, plan: Subject_contra, first: Any = ..., /, *args: Given.args, **given: Given.kwargs
    ) -> Result_co:
        """Ask."""


class Verb(Generic[Subject, Known]):
    """Makes functions of a plan and keyword arguments of those of a plan and checked options.

    Args:
        read: makes a plan of what a caller may give as one, with the options.
        plan: what that is, for people.
    """

    def __init__(self, read: Callable[[Subject, Options], Known], plan: str) -> None:
        self._read = read
        self._plan = plan

    def __call__(
        self, options: Callable[Given, Taken]
    ) -> Callable[[Callable[[Known, Taken], Result]], Callable[Concatenate[Subject, Given], Result]]:
        """Make a function whose keyword arguments are the fields of the options."""

        def decorate(function: Callable[[Known, Taken], Result]) -> Callable[Concatenate[Subject, Given], Result]:
            return cast("Callable[Concatenate[Subject, Given], Result]", self._made(function, options, None))

        return decorate

    def with_first(
        self, options: Callable[Given, Taken], first: str
    ) -> Callable[[Callable[[Known, Taken], Result]], WithFirst[Subject, Given, Result]]:
        """Make such a function, one option of which may also be given by its place, behind the plan."""

        def decorate(function: Callable[[Known, Taken], Result]) -> WithFirst[Subject, Given, Result]:
            return cast("WithFirst[Subject, Given, Result]", self._made(function, options, first))

        return decorate

    def _made(self, function: Callable[..., Any], options: Callable[..., Options], first: str | None) -> object:
        taken = cast("type[Options]", options)
        names = () if first is None else (first,)

        @wraps(function)
        def called(plan: Subject, *args: Any, **given: Any) -> Any:
            if len(args) > len(names) or given.keys() & set(names[: len(args)]):
                raise TypeError(f"{function.__name__}() takes a plan and keyword arguments: see help(…)")
            chosen = taken(**dict(zip(names, args, strict=False)), **given)
            with noticing_interrupts():
                return function(self._read(plan, chosen), chosen)

        called.__signature__ = self._signature(function, taken, first)  # type: ignore[attr-defined]
        called.__doc__ = self._documented(inspect.getdoc(function) or "", taken)
        return called

    def _signature(self, function: Callable[..., Any], options: type[Options], first: str | None) -> inspect.Signature:
        by_place, by_name = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY
        types: dict[str, Any] = {}
        for base in reversed(options.__mro__):
            types |= inspect.get_annotations(base)
        found = [inspect.Parameter("plan", by_place, annotation="Plan")]
        for name, one in sorted(in_order(options), key=lambda each: each[0] != first):
            kind = by_place if name == first else by_name
            found.append(inspect.Parameter(name, kind, default=one.default, annotation=types[name]))
        return inspect.Signature(found, return_annotation=function.__annotations__["return"])

    def _documented(self, text: str, options: type[Options]) -> str:
        """A docstring with the help of each option as the description of an argument."""
        lines = [f"plan: {self._plan}.", *(f"{name}: {one.help}." for name, one in in_order(options))]
        wrapped = [textwrap.fill(line, 110, initial_indent="    ", subsequent_indent="        ") for line in lines]
        summary, _, rest = text.partition("\n\n")
        return "\n".join([summary, "", "Args:", *wrapped, "", rest])


def in_order(options: type[Options]) -> list[tuple[str, Option]]:
    """The fields of options as in help texts, callbacks last."""
    return sorted(options.declarations.items(), key=lambda each: (not each[1].shown, each[1].rank))
