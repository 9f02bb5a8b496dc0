"""Declarations of options: each once, with name, type, default, help, and what it may be combined with.

A command line and the Python function of the same name are read into one object of a class of options, which checks
values and combinations when it is made. Messages name an option as it was given: `--beta` as it was typed, `beta` in
Python.

Functions made from declared options: what a command takes by name, a function takes as keyword arguments.
"""

from __future__ import annotations

import inspect
import os
import re
import textwrap
import typing
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from fractions import Fraction
from functools import wraps
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Concatenate, Generic, ParamSpec, Protocol, Self, TypeVar

from robust.errors import InputError, InputWarning, Location, did_you_mean, missing
from robust.numbers import EXPECTED_NUMBER, Number, exact, parse_number, quoted, shorten
from robust.smt.limits import one_question

if TYPE_CHECKING:
    from robust.irr.search import EnvelopeResult
    from robust.qe.box import Box, Interval

Range = tuple[Number | None, Number | None]
"""All numbers between two, None where there is no end."""

PLOT_SUFFIXES = (".svg", ".png", ".pdf")
STNU_SUFFIXES = (".stnu", ".json")
_LONGEST = Fraction(10) ** 9
_NAMED = 3
"""Files that a message names, of several."""


class Option(typing.NamedTuple):
    """The declaration of an option, without its name and type.

    Attributes:
        default: `...` if it must be given; a bool makes a flag, an int a whole number, everything else a text.
        help: for people.
        names: as it is typed, if not `--` and the name of the field.
        metavar: stands for the value in help texts.
        choices: the values, if there are only some.
        read: makes a value of what was given, or raises InputError at the place.
        needs: another option, and the values that it must have.
        argument: typed without a name, by its place.
        many: may be given more than once; the field is a tuple.
        path: a file or a directory.
        also: the files that would be written as well, of which some may be there already; see :func:`refuse_replacing`.
        shown: False for callbacks, which cannot be typed.
        rank: options of equal rank are shown in the order of declaration, before those of higher rank.
    """

    default: Any
    help: str
    names: tuple[str, ...]
    metavar: str | None = None
    choices: tuple[str, ...] = ()
    read: Callable[[Any, Location], Any] | None = None
    needs: tuple[str, tuple[str, ...]] | None = None
    argument: bool = False
    many: bool = False
    path: bool = False
    also: Callable[[Path], Iterable[Path]] | None = None
    shown: bool = True
    rank: int = 0

    @property
    def flag(self) -> bool:
        """Whether the option is typed without a value."""
        return isinstance(self.default, bool) or any("/" in name for name in self.names)


def option(default: Any, help: str, *names: str, choices: Iterable[str] = (), **more: Any) -> Any:
    """A field of an options class; `more` as for :class:`Option`."""
    return Option(default, help, names, choices=tuple(choices), **more)


def argument(default: Any, help: str, metavar: str, *, many: bool = False) -> Any:
    """A file that is typed without a name, or several."""
    return option(default, help, metavar=metavar, argument=True, many=many, path=True)


def path_option(help: str, *names: str, default: Any = None, metavar: str = "FILE", **more: Any) -> Any:
    """A file or a directory; `more` as for :func:`option`."""
    return option(default, help, *names, metavar=metavar, path=True, **more)


def output_option(help: str, *, metavar: str = "FILE", **more: Any) -> Any:
    """The file that an answer is written to."""
    return path_option(help, "--output", "-o", metavar=metavar, **more)


def callback(help: str) -> Any:
    """A function that is called on the way, which cannot be typed."""
    return option(None, help, shown=False)


def declared(options: type[Options]) -> dict[str, Option]:
    """The options that can be typed, in the order in which help shows them."""
    items = sorted(options.declarations.items(), key=lambda item: item[1].rank)
    return {name: option for name, option in items if option.shown}


def names_of(name: str, declaration: Option) -> tuple[str, ...]:
    """The names of an option when typed; a flag that is set by default has a second one, after a slash, to unset it."""
    if declaration.names:
        return declaration.names
    plain = name.replace("_", "-")
    return (f"--{plain}/--no-{plain}" if declaration.default is True else f"--{plain}",)


def typed(options: Options, *kinds: type[Options]) -> tuple[str, ...]:
    """The words on a command line for options of these kinds that differ from their defaults; files aside."""
    return tuple(
        word
        for kind in kinds
        for name, option in declared(kind).items()
        if not option.path and (value := getattr(options, name)) != option.default
        for word in _words(names_of(name, option)[0], option, value)
    )


def _words(spelling: str, option: Option, value: Any) -> Iterator[str]:
    positive, _, negative = spelling.partition("/")
    if option.flag:
        yield positive if value else negative
    elif option.many:
        yield from (f"{spelling}={item}" for item in value)
    else:
        yield f"{spelling}={','.join(value) if isinstance(value, tuple) else value}"


# -- how options are called in messages --------------------------------------------------------------------------------

_typed: ContextVar[tuple[frozenset[str], Mapping[str, Option]] | None] = ContextVar("typed", default=None)


@contextmanager
def as_typed(names: Iterable[str], options: type[Options] | None = None) -> Iterator[None]:
    """Make messages name options as on the command line; `names` are the options that were given there."""
    token = _typed.set((frozenset(names), {} if options is None else options.declarations))
    try:
        yield
    finally:
        _typed.reset(token)


def spelled(name: str) -> str:
    """An option as whoever gave it calls it."""
    if (typed := _typed.get()) is None:
        return name
    declaration = typed[1].get(name)
    known = f"--{name.replace('_', '-')}" if declaration is None else names_of(name, declaration)[0]
    return known.partition("/")[0]


def place_of(name: str, text: str | None = None) -> Location:
    """The location that a message about an option names."""
    return Location(spelled(name) if text is None else f"{spelled(name)} {shorten(text)}")


def setting(name: str, *values: str) -> str:
    """An option with a value, or one of several, as whoever gives it writes it."""
    if _typed.get() is None:
        return f"{name}={' or '.join(map(repr, values))}"
    return f"{spelled(name)} {' or '.join(values)}"


@typing.dataclass_transform(kw_only_default=True, frozen_default=True)
class Options:
    """Options that have been checked: classes whose fields are declared by :func:`option`, and given by keywords.

    They behave as frozen dataclasses do, without the milliseconds that it takes to make one.
    """

    declarations: ClassVar[Mapping[str, Option]] = {}
    written: ClassVar[tuple[str, ...]] = ("output", "plot", "html", "csv", "stnu")
    """Options that name a file for the answer."""

    def __init_subclass__(cls) -> None:
        """Collect what is declared here and by base classes."""
        declarations: dict[str, Option] = {}
        for base in reversed(cls.__mro__):
            declarations |= {name: value for name, value in vars(base).items() if isinstance(value, Option)}
        cls.declarations = declarations

    if not TYPE_CHECKING:

        def __init__(self, **given: Any) -> None:
            unknown = given.keys() - self.declarations.keys()
            missing = {name for name, option in self.declarations.items() if option.default is ...} - given.keys()
            if unknown or missing:
                problem = "an unexpected" if unknown else "no"
                name = min(unknown or missing)
                raise TypeError(f"{type(self).__name__} got {problem} keyword argument {name!r}")
            for name, option in self.declarations.items():
                object.__setattr__(self, name, given.get(name, option.default))
            self._check()

        def __setattr__(self, name: str, value: Any) -> None:
            raise AttributeError(f"cannot assign to option {name!r}; expected other options to be made")

    def changed(self, **changes: Any) -> Self:
        """A copy of the options with other values for some."""
        return type(self)(**{**vars(self), **changes})

    def _check(self) -> None:
        typed = _typed.get()
        given = {name for name, option in self.declarations.items() if getattr(self, name) != option.default}
        self._check_combinations(given if typed is None else typed[0])
        for name, option in self.declarations.items():
            value = getattr(self, name)
            if value is None:
                continue
            _check_kind(name, option, value)
            if option.choices and value not in option.choices:
                noun = name.replace("backend", "back end")
                raise InputError(f"unknown {noun} {value!r}{did_you_mean(str(value), option.choices)}")
            if option.read is not None:
                object.__setattr__(self, name, option.read(value, place_of(name)))
        self._check_files()

    def _check_files(self) -> None:
        """InputError if a file is to be written that is read, or twice, or whose name a terminal would not show as it
        is; or if files would be overwritten that no option names."""
        items = self.declarations.items()
        files = [(option, getattr(self, name), place_of(name)) for name, option in items if option.path]
        uses: dict[str, str] = {}
        for name, option in items:
            if option.path and name not in self.written and (value := getattr(self, name)):
                for file in map(Path, value if option.many else [value]):
                    uses[os.path.realpath(file)] = "which is read"
                    if option.argument and name != "logs" and file.suffix not in {"", ".pddl"}:
                        beside = os.path.realpath(file.with_suffix(".toml"))
                        uses.setdefault(beside, f"where parameters of {quoted(file)} are read")
        for name in self.written:
            path = getattr(self, name, None)
            if not isinstance(path, Path) or (path.exists() and not path.is_file()):
                continue
            if not str(path).isprintable():
                raise InputError(f"found {quoted(path)}, expected a name without control characters", place_of(name))
            if use := uses.get(os.path.realpath(path)):
                raise InputError(f"found {quoted(path)}, {use}, expected another file", place_of(name))
            uses[os.path.realpath(path)] = f"which {spelled(name)} names"
        named = {Path(file) for option, value, _ in files if value for file in (value if option.many else [value])}
        for option, path, place in files:
            if option.also is not None and path is not None:
                written = set(option.also(Path(path)))
                refuse_replacing(sorted(written), place, force=getattr(self, "force", False))
                if taken := written & named:
                    message = f"found {quoted(min(taken))}, which is another option, expected another name"
                    raise InputError(message, place)

    def _check_combinations(self, given: Collection[str]) -> None:
        for name, option in self.declarations.items():
            if name not in given or option.needs is None:
                continue
            other, values = option.needs
            if (value := getattr(self, other)) not in values:
                raise InputError(
                    f"found it with {setting(other, value)}, expected {setting(other, *values)}, or no {spelled(name)}",
                    place_of(name),
                )
        self.check_combinations(given)

    def check_combinations(self, given: Collection[str]) -> None:
        """InputError if the options that were given do not belong together; for rules that `needs` cannot say."""


def refuse(names: Iterable[str], given: Collection[str], reason: str) -> None:
    """InputError for the first of these options that was given."""
    for name in names:
        if name in given:
            raise InputError(reason, place_of(name))


def _check_kind(name: str, option: Option, value: object) -> None:
    """InputError if a value is not of the kind of its option, where nothing else finds that out."""
    if option.flag:
        right, expected = isinstance(value, bool), "True or False"
    elif option.path and not option.many:
        right, expected = isinstance(value, str | os.PathLike), "a path"
    elif name.startswith("on_"):
        right, expected = callable(value), "a function"
    elif isinstance(option.default, int) and option.read is None:
        right, expected = isinstance(value, int) and not isinstance(value, bool), "a whole number"
    else:
        return
    if not right:
        raise InputError(f"found {shorten(repr(value))}, expected {expected}", place_of(name))


# -- values ------------------------------------------------------------------------------------------------------------


def number_with(holds: Callable[[Fraction], bool], expected: str) -> Callable[[Number, Location], Fraction]:
    """What reads a number, with InputError unless this holds of it."""

    def read(value: Number, place: Location) -> Fraction:
        number = exact(value, place)
        if not holds(number):
            raise InputError(f"found {shorten(str(value))}, expected {expected}", place)
        return number

    return read


def whole_number(holds: Callable[[Fraction], bool], expected: str) -> Callable[[int | str, Location], int]:
    """What reads a whole number, with InputError unless this holds of it."""
    read = number_with(lambda number: number.denominator == 1 and holds(number), expected)
    return lambda value, place: int(read(value, place))


positive = number_with(lambda number: number > 0, "a number above 0")
not_negative = number_with(lambda number: number >= 0, "a number of at least 0")
share = number_with(lambda number: 0 <= number <= 1, "a number from 0 to 1")
proper_share = number_with(lambda number: 0 < number < 1, "a number above 0 and below 1")
ordinal = whole_number(lambda number: number >= 1, "a whole number from 1")


def seconds(value: Number, place: Location) -> float:
    """A time limit; 0 only from a program, which may have no time left."""
    number = positive(value, place) if isinstance(value, str) else not_negative(value, place)
    return float(min(number, _LONGEST))


def names(value: str | Sequence[str], place: Location) -> tuple[str, ...]:
    """Names, or a text with commas between them."""
    if not isinstance(value, str):
        return texts(value, place)
    parts = tuple(name.strip() for name in value.split(","))
    if not all(parts):
        raise InputError(f"found {shorten(value)}, expected names such as a,b,c", place)
    return parts


def texts(value: str | Sequence[str], place: Location) -> tuple[str, ...]:
    """Texts; one may be given by itself."""
    items = (value,) if isinstance(value, str) else value
    if not isinstance(items, Iterable) or isinstance(items, bytes | Mapping):
        raise InputError(f"found {shorten(repr(value))}, expected texts", place)
    items = tuple(items)
    for item in items:
        if not isinstance(item, str):
            raise InputError(f"found {shorten(repr(item))}, expected a text", place)
    return items


def named_values(given: Mapping[str, str] | str | Sequence[str], option: str) -> dict[str, str]:
    """Values by name, also of texts `NAME=VALUE`: each name at most once, unless it is said again.

    Raises:
        InputError: for anything else.
    """
    if isinstance(given, Mapping):
        for name, value in given.items():
            texts((name, value), place_of(option))
        return dict(given)
    values: dict[str, str] = {}
    for text in texts(given, place_of(option)):
        place = place_of(option, text)
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name or not value:
            raise InputError(f"found {shorten(text)}, expected NAME=VALUE", place)
        if values.setdefault(name, value) != value:
            raise InputError(f"found a second value for {shorten(name)}, expected one", place)
    return values


def plot_file(path: str | Path, place: Location) -> Path:
    """InputError unless a plot can be written to the path and its suffix names a format."""
    if find_spec("matplotlib") is None:
        raise missing("matplotlib, which draws", "plots")
    path = Path(path)
    if path.suffix.lower() not in PLOT_SUFFIXES:
        raise InputError(f"found {shorten(str(path))}, expected a name that ends in {', '.join(PLOT_SUFFIXES)}", place)
    return writable(path, place, "the plot")


def beside(plan: Path) -> tuple[Path, ...]:
    """The file of parameters that belongs to a plan."""
    return (plan.with_suffix(".toml"),)


def plan_file(path: Path, place: Location) -> Path:
    """InputError unless a plan can be written there."""
    if path.suffix == ".toml":
        raise InputError(f"found {shorten(str(path))}, expected a plan's name: parameters go to .toml files", place)
    return writable(path, place, "the plan")


def writable(path: Path, place: Location, what: str) -> Path:
    """InputError unless a file can be written to the path: better known before anything is computed."""
    if str(path) == "-":
        raise InputError("found '-', expected the name of a file; /dev/stdout is standard output", place)
    if not path.parent.is_dir():
        raise InputError(f"there is no directory {quoted(path.parent)} to write {what} to; name another", place)
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise InputError(f"cannot write {quoted(path)}, expected a file that can be written", place)
    return path


def written_to(what: str) -> Callable[[str | Path, Location], Path]:
    """A check that a file can be written to a path."""
    return lambda path, place: writable(Path(path), place, what)


def refuse_replacing(files: Iterable[Path], place: Location, *, force: bool) -> None:
    """InputError if files exist that no option names, unless they are to be replaced."""
    there = [] if force else [quoted(path) for path in files if os.path.lexists(path)]
    if there:
        shown = ", ".join(there[:_NAMED]) + (f" and {len(there) - _NAMED} more" if len(there) > _NAMED else "")
        raise InputError(f"found {shown}, expected no such files; {spelled('force')} replaces them", place)


Settings = Mapping[str, "Number | Interval | Range"] | str | Sequence[str]
"""Values and intervals of parameters, by name or as texts `NAME=VALUE` and `NAME=LOW:HIGH`."""


def settings(
    given: Settings | Box | EnvelopeResult,
    known: Sequence[str] | None,
    option: str = "at",
    groups: Collection[str] = (),
) -> dict[str, Interval]:
    """Values and intervals of parameters, each at most once, as intervals; an envelope is its box.

    Args:
        given: the values; among texts, `@FILE` stands for the lines of a file, of which those about what is not known
            are skipped with a warning.
        known: the plan's parameters; None if somebody else says what is none.
        option: what errors are about.
        groups: names that are known as well.

    Raises:
        InputError: for anything else, or an envelope whose box is not verified.
    """
    from robust.qe.box import Box  # noqa: PLC0415 - options are read before anything else is imported

    intervals: dict[str, Interval] = {}
    if not isinstance(given, Mapping | str | Sequence):
        if not getattr(given, "verified", True):
            raise InputError("the envelope has no verified box; give one that has", place_of(option))
        box = given if isinstance(given, Box) else getattr(given, "box", None)
        if not isinstance(box, Box):
            expected = "a box, an envelope, or values and intervals by parameter"
            raise InputError(f"found {shorten(repr(given))}, expected {expected}", place_of(option))
        given = box.intervals

    def is_known(name: str) -> bool:
        return known is None or name in known or name in groups

    if isinstance(given, Mapping):
        for name, setting in given.items():
            if not is_known(name):
                raise InputError(f"unknown parameter {name!r}{did_you_mean(str(name), known or ())}")
            intervals[name] = _setting_of(setting, place_of(option, name))
        return intervals
    for text, place in _lines(texts(given, place_of(option)), is_known, option):
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name:
            raise InputError(f"found {shorten(text)}, expected NAME=VALUE or NAME=LOW:HIGH", place)
        if not is_known(name):
            raise InputError(f"found unknown parameter {shorten(name)}{did_you_mean(name, known or ())}", place)
        if name in intervals:
            raise InputError(f"found a second value for {shorten(name)}, expected one", place)
        intervals[name] = _interval_of(value, place)
    return intervals


def _lines(given: Iterable[str], is_known: Callable[[str], bool], option: str) -> Iterator[tuple[str, Location]]:
    """Texts, and for `@FILE` the lines of a file about what is known, each with its place."""
    for text in given:
        if not text.startswith("@"):
            yield text, place_of(option, text)
            continue
        if text == "@":
            raise InputError("found no file behind @, expected @FILE", place_of(option, text))
        from robust.plan.pddl.forms import read_text  # noqa: PLC0415 - as above

        lines = [line.strip() for line in read_text(text[1:]).split("\n")]
        said = [(line, Location(text[1:], at)) for at, line in enumerate(lines, start=1) if line and line[0] != "#"]
        skipped = [line for line, _ in said if "=" in line and not is_known(line.partition("=")[0].strip())]
        if len(skipped) == len(said):
            found = "found nothing about a parameter of the plan, expected lines NAME=VALUE or NAME=LOW:HIGH"
            remedy = "--parameter 'duration:*' makes all durations parameters"
            raise InputError(f"{found}; {remedy}", Location(text[1:]))
        if skipped:
            message = (
                f"{text[1:]}: skipped {len(skipped)} of {len(said)} lines, which are about no parameter of the plan"
            )
            warnings.warn(InputWarning(f"{message}, such as {shorten(skipped[0])}"), stacklevel=4)
        yield from (pair for pair in said if pair[0] not in skipped)


def _interval_of(text: str, place: Location) -> Interval:
    """A value, or LOW:HIGH."""
    from robust.qe.box import Interval  # noqa: PLC0415 - as above

    low, colon, high = (part.strip() for part in text.partition(":"))
    if not colon:
        number = parse_number(low, place)
        return Interval(number, number)
    lower, upper = _end(low, place), _end(high, place)
    if low in {"inf", "+inf"} or high == "-inf" or (lower is not None and upper is not None and lower > upper):
        raise InputError(f"found {shorten(text)}, expected LOW:HIGH with LOW not above HIGH", place)
    return Interval(lower, upper, lower_closed=lower is not None, upper_closed=upper is not None)


def _setting_of(setting: Number | Interval | Range, place: Location) -> Interval:
    """A value or an interval, exactly."""
    from robust.qe.box import Interval  # noqa: PLC0415 - as above

    ends: Sequence[Number | None]
    if isinstance(setting, Interval):
        ends = (setting.lower, setting.upper)
        closed = (setting.lower_closed, setting.upper_closed)
    elif not isinstance(setting, tuple | list):
        number = exact(setting, place)
        return Interval(number, number)
    elif len(setting) != 2:
        raise InputError(f"found {len(setting)} numbers, expected a lower and an upper end", place)
    else:
        ends, closed = setting, (True, True)
    lower, upper = (_finite(end, word, place) for end, word in zip(ends, ("-inf", "inf"), strict=True))
    if lower is not None and upper is not None and lower > upper:
        raise InputError(f"found {lower} and {upper}, expected a lower end that is not above the upper one", place)
    return Interval(
        lower, upper, lower_closed=lower is not None and closed[0], upper_closed=upper is not None and closed[1]
    )


def _finite(value: Number | None, infinite: str, place: Location) -> Fraction | None:
    """An end of an interval; None if it is infinite to its own side."""
    return None if value is None or str(value).lower() == infinite else exact(value, place)


def _end(text: str, place: Location) -> Fraction | None:
    if text in {"inf", "+inf", "-inf"}:
        return None
    if not text:
        raise InputError(f"found an empty end of an interval, expected {EXPECTED_NUMBER}, inf or -inf", place)
    return parse_number(text, place)


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
        elsewhere: by names of arguments that belong to another function, which it is.
    """

    def __init__(
        self, read: Callable[[Subject, Options], Known], plan: str, elsewhere: Mapping[str, str] | None = None
    ) -> None:
        self._read = read
        self._plan = plan
        self._elsewhere = elsewhere or {}

    def __call__(
        self, options: Callable[Given, Taken]
    ) -> Callable[[Callable[[Known, Taken], Result]], Callable[Concatenate[Subject, Given], Result]]:
        """Make a function whose keyword arguments are the fields of the options."""
        return lambda function: self._made(function, options)

    def with_first(
        self, options: Callable[Given, Taken], first: str
    ) -> Callable[[Callable[[Known, Taken], Result]], WithFirst[Subject, Given, Result]]:
        """Make a function, one option of which may also be given by its place, behind the plan."""
        return lambda function: self._made(function, options, first)

    def _made(self, function: Callable[..., Any], options: Any, *first: str) -> Any:
        @wraps(function)
        def called(plan: Subject, *args: Any, **given: Any) -> Any:
            if len(args) > len(first) or given.keys() & set(first[: len(args)]):
                name = function.__name__
                raise TypeError(f"{name}() takes one plan, such as [domain, problem, plan], and options by name")
            require_known(function.__name__, (*first, *given), options, self._elsewhere)
            chosen = options(**dict(zip(first, args, strict=False)), **given)
            with one_question():
                return function(self._read(plan, chosen), chosen)

        parameter = inspect.Parameter("plan", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation="Plan")
        return stated(called, options, [parameter], *first, about=f"\nArgs:\n{described('plan', self._plan)}\n")


def stated(
    function: Any, options: type[Options], parameters: Iterable[inspect.Parameter], *first: str, about: str = ""
) -> Any:
    """A function whose signature and docstring say which options it takes by name, behind these parameters.

    Args:
        function: what is called; its docstring has a section on what it returns.
        options: whose help is said of each.
        parameters: of the function, but for options.
        first: the option that may be given by its place as well, if there is one.
        about: what is said of the parameters, where the docstring does not say it.
    """
    by_place, by_name = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY
    types = {name: kind for base in reversed(options.__mro__) for name, kind in inspect.get_annotations(base).items()}
    every = list(parameters)
    for name, option in sorted(in_order(options), key=lambda item: item[0] not in first):
        kind = by_place if name in first else by_name
        every.append(inspect.Parameter(name, kind, default=option.default, annotation=types[name]))
    returned = inspect.get_annotations(function)["return"]
    function.__signature__ = inspect.Signature(every, return_annotation=returned)
    said, section, rest = (inspect.getdoc(function) or "").partition("\n\nReturns:")
    arguments = "\n".join(described(name, _in_python(option.help, options)) for name, option in in_order(options))
    function.__doc__ = f"{said}\n{about}{arguments}{section}{rest}"
    return function


def require_known(function: str, given: Iterable[str], options: type[Options], elsewhere: Mapping[str, str]) -> None:
    """TypeError if something is given that is no option; `elsewhere` tells where it belongs."""
    for name in given:
        if name not in options.declarations:
            where = f"; {elsewhere[name]}" if name in elsewhere else did_you_mean(name, options.declarations)
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}{where}")


def _in_python(text: str, options: type[Options]) -> str:
    """Help that speaks of arguments instead of options; a condition on an option that is no argument always holds."""
    known = {name.replace("_", "-"): name for name in options.declarations}
    said = re.sub(r"^with --([a-z-]+): ", lambda match: match[0] if match[1] in known else "", text)
    said = re.sub(r"--([a-z-]+)", lambda match: f"`{known[match[1]]}`" if match[1] in known else match[0], said)
    return said.replace("; may be repeated", "; one or several")


def described(name: str, text: str) -> str:
    """A line about an argument, wrapped."""
    return textwrap.fill(f"{name}: {text}.", 110, initial_indent="    ", subsequent_indent="        ")


def in_order(options: type[Options]) -> list[tuple[str, Option]]:
    """The fields of options as in help texts, callbacks last."""
    return sorted(options.declarations.items(), key=lambda item: (not item[1].shown, item[1].rank))
