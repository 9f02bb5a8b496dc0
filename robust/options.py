"""Every option once: name, type, default, help, and what it may be combined with.

A command line and the Python function of the same name are read into one object of a class below, which checks values
and combinations when it is made. Messages name an option as it was given: `--beta` as it was typed, `beta` in Python.
Those of `robust pike` are declared in the same way in :mod:`robust.cli.pike`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, dataclass_transform

from robust.backends import ELIMINATORS, ENCODINGS, OFFERED, SOLVERS, SPLITTINGS
from robust.errors import InputError, Location, did_you_mean
from robust.numbers import EXPECTED_NUMBER, parse_number, shorten

if TYPE_CHECKING:
    from robust.irr.repair import Cost
    from robust.irr.search import Step
    from robust.probability.distributions import Distribution
    from robust.probability.measure import Bounds
    from robust.qe.box import Interval
    from robust.qe.polyhedron import Polyhedron

Number = int | str | Fraction | Decimal | float
"""An exact number: a text such as `1/3`, and a float is what it is printed as."""

PLOT_SUFFIXES = (".svg", ".png", ".pdf")
STNU_SUFFIXES = (".stnu", ".json")
_LONGEST = Fraction(10) ** 9


class Option(NamedTuple):
    """What is declared of an option, beside its name and type; see :func:`option`."""

    default: Any
    help: str
    names: tuple[str, ...]
    metavar: str | None
    choices: tuple[str, ...]
    accepted: Collection[str]
    read: Callable[[Any, Location], Any] | None
    needs: tuple[str, tuple[str, ...]] | None
    argument: bool
    many: bool
    path: bool
    shown: bool
    rank: int

    @property
    def flag(self) -> bool:
        """Whether it is typed without a value."""
        return isinstance(self.default, bool) or any("/" in name for name in self.names)


def option(
    default: Any,
    help: str,
    *names: str,
    metavar: str | None = None,
    choices: Iterable[str] = (),
    accepted: Collection[str] | None = None,
    read: Callable[[Any, Location], Any] | None = None,
    needs: tuple[str, tuple[str, ...]] | None = None,
    argument: bool = False,
    many: bool = False,
    path: bool = False,
    shown: bool = True,
    rank: int = 0,
) -> Any:
    """A field of an options class.

    Args:
        default: `...` if it must be given; a bool makes a flag, an int a whole number, everything else a text.
        help: for people.
        names: as it is typed, if not `--` and the name of the field.
        metavar: stands for the value in help texts.
        choices: the values, if there are only some.
        accepted: those that are accepted from Python, if more.
        read: makes a value of what was given, or raises InputError at the place.
        needs: another option, and the values that it must have.
        argument: typed without a name, by its place.
        many: may be given more than once; the field is a tuple.
        path: a file or a directory.
        shown: False for callbacks, which cannot be typed.
        rank: options of equal rank are shown in the order of declaration, before those of higher rank.
    """
    choices = tuple(choices)
    known = choices if accepted is None else accepted
    return Option(default, help, names, metavar, choices, known, read, needs, argument, many, path, shown, rank)


def argument(default: Any, help: str, metavar: str, *, many: bool = False) -> Any:
    """A file that is typed without a name, or several."""
    return option(default, help, metavar=metavar, argument=True, many=many, path=True)


def declared(options: type[Options]) -> dict[str, Option]:
    """The options that can be typed, in the order in which help shows them."""
    found = sorted(options.declarations.items(), key=lambda each: each[1].rank)
    return {name: one for name, one in found if one.shown}


def names_of(name: str, declaration: Option) -> tuple[str, ...]:
    """How an option is typed; a flag that is set by default has a second name that unsets it, after a slash."""
    if declaration.names:
        return declaration.names
    plain = name.replace("_", "-")
    return (f"--{plain}/--no-{plain}" if declaration.default is True else f"--{plain}",)


# -- how options are called in messages --------------------------------------------------------------------------------

_typed: ContextVar[frozenset[str] | None] = ContextVar("typed", default=None)


@contextmanager
def as_typed(names: Iterable[str]) -> Iterator[None]:
    """Within it, messages name options as on the command line, on which these fields were given."""
    token = _typed.set(frozenset(names))
    try:
        yield
    finally:
        _typed.reset(token)


def spelled(name: str) -> str:
    """An option as whoever gave it calls it."""
    return name if _typed.get() is None else f"--{name.replace('_', '-')}"


def place_of(name: str, text: str | None = None) -> Location:
    """Where a message about an option points to."""
    return Location(spelled(name) if text is None else f"{spelled(name)} {shorten(text)}")


def _setting(name: str, *values: str) -> str:
    if _typed.get() is None:
        return f"{name}={' or '.join(map(repr, values))}"
    return f"{spelled(name)} {' or '.join(values)}"


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Options:
    """Options that have been checked: classes whose fields are declared by :func:`option`, and given by keywords.

    They behave as frozen dataclasses do, without the milliseconds that it takes to make one.
    """

    declarations: ClassVar[Mapping[str, Option]] = {}

    def __init_subclass__(cls) -> None:
        """Collect what is declared here and by base classes."""
        found: dict[str, Option] = {}
        for base in reversed(cls.__mro__):
            found |= {name: value for name, value in vars(base).items() if isinstance(value, Option)}
        cls.declarations = found

    if not TYPE_CHECKING:

        def __init__(self, **given: Any) -> None:
            unknown = given.keys() - self.declarations.keys()
            missing = {name for name, one in self.declarations.items() if one.default is ...} - given.keys()
            if unknown or missing:
                problem = "an unexpected" if unknown else "no"
                name = min(unknown or missing)
                raise TypeError(f"{type(self).__name__} got {problem} keyword argument {name!r}")
            for name, one in self.declarations.items():
                object.__setattr__(self, name, given.get(name, one.default))
            self._check()

        def __setattr__(self, name: str, value: Any) -> None:
            raise AttributeError(f"cannot assign to option {name!r}; expected other options to be made")

    def changed(self, **changes: Any) -> Self:
        """The same options with other values for some."""
        return type(self)(**{**vars(self), **changes})

    def _check(self) -> None:
        typed = _typed.get()
        given = {name for name, one in self.declarations.items() if getattr(self, name) != one.default}
        self._check_combinations(given if typed is None else typed)
        for name, one in self.declarations.items():
            value = getattr(self, name)
            if value is None:
                continue
            if one.accepted and value not in one.accepted:
                noun = name.replace("backend", "back end")
                raise InputError(f"unknown {noun} {value!r}{did_you_mean(str(value), one.accepted)}")
            if one.read is not None:
                object.__setattr__(self, name, one.read(value, place_of(name)))

    def _check_combinations(self, given: Collection[str]) -> None:
        for name, one in self.declarations.items():
            if name not in given or one.needs is None:
                continue
            other, values = one.needs
            if (found := getattr(self, other)) not in values:
                raise InputError(
                    f"found it with {_setting(other, found)}, expected {_setting(other, *values)}, or no "
                    f"{spelled(name)}",
                    place_of(name),
                )
        self.check_combinations(given)

    def check_combinations(self, given: Collection[str]) -> None:
        """InputError if the options that were given do not belong together; for rules that `needs` cannot say."""


# -- values ------------------------------------------------------------------------------------------------------------


def exact(value: Number, place: Location) -> Fraction:
    """InputError unless it is a number."""
    if isinstance(value, bool) or not isinstance(value, Number):
        raise InputError(f"found {shorten(repr(value))}, expected {EXPECTED_NUMBER}", place)
    return Fraction(value) if isinstance(value, int | Fraction) else parse_number(str(value).lower(), place)


def positive(value: Number, place: Location) -> Fraction:
    """InputError unless it is a number above 0."""
    number = exact(value, place)
    if number <= 0:
        raise InputError(f"found {shorten(str(value))}, expected a number above 0", place)
    return number


def not_negative(value: Number, place: Location) -> Fraction:
    """InputError unless it is a number of at least 0."""
    number = exact(value, place)
    if number < 0:
        raise InputError(f"found {shorten(str(value))}, expected a number of at least 0", place)
    return number


def ordinal(value: int | str, place: Location) -> int:
    """InputError unless it is a whole number from 1."""
    number = exact(value, place)
    if number.denominator != 1 or number < 1:
        raise InputError(f"found {shorten(str(value))}, expected a whole number from 1", place)
    return int(number)


def seconds(value: Number, place: Location) -> float:
    """A time limit; 0 only from a program, which may have no time left."""
    number = positive(value, place) if isinstance(value, str) else not_negative(value, place)
    return float(min(number, _LONGEST))


def names(value: str | Sequence[str], place: Location) -> tuple[str, ...]:
    """Names, or a text with commas between them."""
    if not isinstance(value, str):
        return tuple(value)
    found = tuple(name.strip() for name in value.split(","))
    if not all(found):
        raise InputError(f"found {shorten(value)}, expected names such as a,b,c", place)
    return found


def plot_file(path: str | Path, place: Location) -> Path:
    """InputError unless a plot can be written to the path and its suffix names a format."""
    path = Path(path)
    if path.suffix.lower() not in PLOT_SUFFIXES:
        raise InputError(f"found {shorten(str(path))}, expected a name that ends in {', '.join(PLOT_SUFFIXES)}", place)
    return writable(path, place, "the plot")


def writable(path: Path, place: Location, what: str) -> Path:
    """InputError unless a file can be written to the path: better known before anything is computed."""
    if not path.parent.is_dir():
        raise InputError(f"found no directory {shorten(str(path.parent))}, expected one to write {what} to", place)
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise InputError(f"cannot write {shorten(str(path))}, expected a file that can be written", place)
    return path


def settings(
    given: Mapping[str, Number | Interval] | Sequence[str], known: Sequence[str], option: str = "at"
) -> dict[str, Fraction | Interval]:
    """Values and intervals of parameters, each at most once; of texts `NAME=VALUE` and `NAME=LOW:HIGH`, too."""
    from robust.qe.box import Interval  # noqa: PLC0415 - options are read before anything else is imported

    found: dict[str, Fraction | Interval] = {}
    if isinstance(given, Mapping):
        for name, setting in given.items():
            if name not in known:
                raise InputError(f"unknown parameter {name!r}{did_you_mean(name, known)}")
            found[name] = setting if isinstance(setting, Interval) else exact(setting, place_of(option, name))
        return found
    for text in given:
        place = place_of(option, text)
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name:
            raise InputError(f"found {shorten(text)}, expected NAME=VALUE or NAME=LOW:HIGH", place)
        if name not in known:
            raise InputError(f"found unknown parameter {shorten(name)}{did_you_mean(name, known)}", place)
        if name in found:
            raise InputError(f"found a second value for {shorten(name)}, expected one", place)
        low, colon, high = (part.strip() for part in value.partition(":"))
        if not colon:
            found[name] = parse_number(low, place)
            continue
        lower, upper = _end(low, place), _end(high, place)
        if low in {"inf", "+inf"} or high == "-inf" or (lower is not None and upper is not None and lower > upper):
            raise InputError(f"found {shorten(value)}, expected LOW:HIGH with LOW not above HIGH", place)
        found[name] = Interval(lower, upper, lower_closed=lower is not None, upper_closed=upper is not None)
    return found


def _end(text: str, place: Location) -> Fraction | None:
    if text in {"inf", "+inf", "-inf"}:
        return None
    if not text:
        raise InputError(f"found an empty end of an interval, expected {EXPECTED_NUMBER}, inf or -inf", place)
    return parse_number(text, place)


# -- what several commands share ---------------------------------------------------------------------------------------

METHODS = ("widen", "irr", "optimal")
PARAMETERS, EPSILON, ENCODING, SOLVING, LIMIT, DRAWING, EXPORT, OUTPUT = range(1, 9)
"""Ranks."""


def separation(read: Callable[[Number, Location], Fraction]) -> Any:
    """ε, at least 0 or above it."""
    what = "separation of mutex time points, in the plan's unit of time"
    return option("1/1000", what, metavar="E", read=read, rank=EPSILON)


class Separation(Options):
    """ε."""

    epsilon: Number = separation(not_negative)

    @property
    def separation(self) -> Fraction:
        """ε as a number."""
        return Fraction(self.epsilon)


class PlanningOutput(Options):
    """What of a planner's output is the plan, and how exact its numbers are."""

    plan_number: int | None = option(
        None,
        "which plan of a log that holds several, from 1; the last one if not given",
        metavar="N",
        read=ordinal,
        rank=EPSILON,
    )
    tolerance: Number | None = option(
        None,
        "how far exact times and durations may be from printed ones, 0 for exactness; if not given, one unit of the "
        "last printed digit, and at most epsilon",
        metavar="T",
        read=not_negative,
        rank=EPSILON,
    )

    @property
    def rounding(self) -> Fraction | None:
        """The tolerance as a number, or None for what printed digits say."""
        return None if self.tolerance is None else Fraction(self.tolerance)


class Limited(Options):
    """For how long."""

    timeout: Number | None = option(
        None, "seconds after which what is known by then is printed", metavar="S", read=seconds, rank=LIMIT
    )

    @property
    def limit(self) -> float | None:
        """Seconds, or None without a limit."""
        return None if self.timeout is None else float(self.timeout)


class Solving(Limited):
    """Whom to ask, and for how long."""

    solver: str = option("z3", "the solver that is asked", choices=SOLVERS, rank=SOLVING)


def encoding_option(rank: int = ENCODING) -> Any:
    """How the plan becomes formulas."""
    return option("relational", "how the plan becomes formulas", choices=ENCODINGS, rank=rank)


class Search(Separation, Solving):
    """What every question about a plan takes."""

    encoding: str = encoding_option()


class Export(Options):
    """Queries as files."""

    smt2: str | Path | None = option(None, "write every query to DIR as SMT-LIB", metavar="DIR", path=True, rank=EXPORT)


class Json(Options):
    """An answer for programs."""

    json: bool = option(False, "print one JSON object on stdout", rank=OUTPUT)


class Output(Json):
    """How a command answers."""

    quiet: bool = option(False, "only the answer: no progress, no notes, no warnings", "--quiet", "-q", rank=OUTPUT)
    verbose: bool = option(False, "log what is done on stderr", "--verbose", "-v", rank=OUTPUT)


class Plot(Options):
    """A picture."""

    plot: Path | None = option(
        None,
        "draw the result: .svg, .png or .pdf by suffix",
        metavar="FILE",
        path=True,
        read=plot_file,
        rank=DRAWING,
    )


class Slice(Plot):
    """A picture of one or two parameters."""

    axes: str | Sequence[str] | None = option(
        None,
        "the one or two parameters to draw, others are at their nominal values",
        metavar="A,B",
        read=names,
        rank=DRAWING,
    )


class Planning(Options):
    """Where the planning problem is."""

    domain: Path = argument(..., "PDDL domain", "DOMAIN")
    problem: Path = argument(..., "PDDL problem", "PROBLEM")


class PlanFiles(Planning):
    """Where the plan is."""

    plan: Path = argument(..., "network (.stn), time-triggered plan or log of a planner; - is standard input", "PLAN")


class PlanParameters(Options):
    """What of a plan are parameters, beside those that it declares."""

    parameter: tuple[str, ...] = option(
        (),
        "make a quantity a parameter: duration:ACTION for all its instances, duration:ID, start:ID, 'fluent:(f a)', "
        "or NAME of an existing one; then ,weight=W ,lb=L ,ub=U ,default=D; may be repeated",
        "--parameter",
        "--parametrize",
        metavar="SPEC",
        many=True,
        rank=PARAMETERS,
    )
    parameters: Path | None = option(
        None,
        "more parameters, in a TOML file; if not given, PLAN.toml beside PLAN.stn",
        metavar="FILE",
        path=True,
        rank=PARAMETERS,
    )


class AskCommand(PlanFiles, PlanningOutput, PlanParameters, Separation, Solving, Output):
    """What every question about a plan takes on the command line."""


# -- the verbs: what the functions take, and what their commands take beside it ---------------------------------------


class CheckOptions(Search, Export):
    """Of :func:`robust.check`."""

    at: Mapping[str, Number | Interval] | Sequence[str] = option(
        (),
        "value of a parameter instead of its nominal one, or NAME=LOW:HIGH for all values between; may be repeated",
        metavar="NAME=VALUE",
        many=True,
    )
    every: bool = option(False, "examine all obligations instead of stopping at the first that breaks", "--all")
    on_obligation: Callable[[int, int, str], None] | None = option(
        None, "called with the number of obligations examined, their total, and the name of the next", shown=False
    )


class CheckCommand(CheckOptions, AskCommand):
    """Of `robust check`."""


def distributions(needs: tuple[str, tuple[str, ...]] | None = None) -> Any:
    """How parameters are distributed."""
    return option(
        (),
        "how a parameter is distributed: NAME=normal:MEAN:DEVIATION, truncated-normal:MEAN:DEVIATION:MINIMUM:MAXIMUM, "
        "half-normal:ORIGIN:DEVIATION, uniform:LOWER:UPPER, triangular:LOWER:MODE:UPPER, exponential:MEAN or "
        "constant:VALUE; an empty mean, mode, origin or value is the planned one; may be repeated",
        metavar="NAME=KIND:...",
        many=True,
        needs=needs,
    )


def world_file(needs: tuple[str, tuple[str, ...]] | None = None) -> Any:
    """The same by a file."""
    return option(
        None,
        "the distributions of parameters and durations, in a TOML file; without a rule, parameters are as planned",
        metavar="FILE",
        path=True,
        needs=needs,
    )


_FOR_RISK = ("method", ("risk",))


class EnvelopeOptions(Separation, Solving, Export):
    """Of :func:`robust.envelope`."""

    method: str = option(
        "widen",
        "widen: exact, no valid box contains the result; irr: step by step, up to a precision; "
        "optimal: exact, the greatest total width of all boxes; risk: the most probable box",
        choices=(*METHODS, "risk"),
    )
    distribution: Mapping[str, str | Distribution] | Sequence[str] = distributions(_FOR_RISK)
    world: str | Path | None = world_file(_FOR_RISK)
    within: Number = option(
        "0.005",
        "for risk: search until no box can be more probable by more than this",
        metavar="W",
        read=positive,
        needs=_FOR_RISK,
    )
    beta: Number | None = option(
        None,
        "for irr: no end of a complete box can move outwards by B; 1 if not given",
        metavar="B",
        read=positive,
        needs=("method", ("irr",)),
    )
    doubling: bool = option(
        False,
        "for irr: steps double until the first failure; ends are up to 2 B away",
        needs=("method", ("irr",)),
    )
    contain_nominal: bool = option(
        False, "for optimal: only boxes around the nominal values", needs=("method", ("optimal",))
    )
    encoding: str = encoding_option(rank=0)
    order: str | Sequence[str] | None = option(
        None,
        "parameters in the order in which they take turns (irr), or are widened one after the other (widen)",
        metavar="A,B,C",
        read=names,
        needs=("method", ("widen", "irr")),
    )
    on_step: Callable[[Step], None] | None = option(
        None, "called after each step with the best box so far", shown=False
    )

    @property
    def precision(self) -> Fraction | None:
        """β, for methods that have one."""
        return Fraction(self.beta or 1) if self.method == "irr" else None

    @property
    def from_nominal(self) -> bool:
        """Whether the box is to be around the nominal values."""
        return self.method != "optimal" or self.contain_nominal


class EnvelopeCommand(EnvelopeOptions, Plot, AskCommand):
    """Of `robust envelope`."""

    controllability: str | None = option(
        None,
        "also tell whether values may be unknown until they are observed (dynamic), or for ever (strong), "
        "shrink the box to the part where they may, and find the widest box where they may",
        choices=("weak", "dynamic", "strong"),
    )


class RegionOptions(Search):
    """Of :func:`robust.region`."""

    backend: str = option(
        "project",
        "who eliminates time points",
        choices=OFFERED,
        accepted=ELIMINATORS,
    )
    splitting: str = option(
        "full",
        "one problem for all, for the plan and its network, or for each part",
        choices=SPLITTINGS,
    )
    learning: bool = option(True, "tell later problems what earlier ones have excluded")
    on_piece: Callable[[Polyhedron], None] | None = option(
        None, "called with each polyhedron of bad parameter values when it is found", shown=False
    )
    on_cell: Callable[[Polyhedron], None] | None = option(
        None, "called with each polyhedron of good parameter values when it is found", shown=False
    )


class RegionCommand(RegionOptions, Slice, AskCommand):
    """Of `robust region`."""

    form: str | None = option(
        None,
        "as a union of polyhedra or as one without others; if not given, a union unless very many are cut out",
        choices=("union", "difference"),
    )
    latex: bool = option(False, "print a formula for LaTeX's mathematical mode")

    def check_combinations(self, given: Collection[str]) -> None:
        if self.latex and self.json:
            raise InputError("found it with --json, expected one of the two", Location("--latex"))


class CompareOptions(Search):
    """Of :func:`robust.compare`."""

    beta: Number = option("1", "the precision of irr", metavar="B", read=positive)
    on_stage: Callable[[str], None] | None = option(None, "called with the name of each stage", shown=False)


def html_file(path: Path, place: Location) -> Path:
    """InputError unless there is a directory to write to."""
    if not path.parent.is_dir():
        raise InputError(f"found no directory {str(path.parent)!r}, expected one to write to", place)
    return path


class CompareCommand(CompareOptions, Slice, AskCommand):
    """Of `robust compare`."""

    html: Path | None = option(
        None, "write a report with a drawing as one HTML file", metavar="FILE", path=True, read=html_file, rank=DRAWING
    )


class RiskOptions(Search):
    """Of :func:`robust.risk`."""

    distribution: Mapping[str, str | Distribution] | Sequence[str] = distributions()
    world: str | Path | None = world_file()
    within: Number = option("0.001", "how close the bounds of the probability are to be", metavar="W", read=positive)
    draws: int | None = option(
        None,
        "also estimate by so many random points; with more than 6 parameters 10000 if bounds are not close",
        metavar="N",
        read=ordinal,
    )
    on_bounds: Callable[[Bounds], None] | None = option(None, "called with bounds that have changed", shown=False)
    on_stage: Callable[[str], None] | None = option(None, "called with the name of each stage", shown=False)


class RiskCommand(RiskOptions, Plot, AskCommand):
    """Of `robust risk`."""

    def check_combinations(self, given: Collection[str]) -> None:
        if not self.distribution and self.world is None:
            raise InputError("found neither --distribution nor --world, expected how parameters are distributed")


# -- other commands about plans ----------------------------------------------------------------------------------------


def plan_file(path: Path, place: Location) -> Path:
    """InputError unless a plan can be written there."""
    if path.suffix == ".toml":
        raise InputError(f"found {shorten(str(path))}, expected a plan's name: parameters go to .toml files", place)
    return writable(path, place, "the plan")


def stnu_file(path: Path, place: Location) -> Path:
    """InputError unless a network can be written there."""
    if path.suffix.lower() not in STNU_SUFFIXES:
        raise InputError(f"found {shorten(str(path))}, expected a name that ends in .stnu or .json", place)
    return writable(path, place, "the network")


class ConvertCommand(PlanFiles, PlanningOutput, PlanParameters, Separation, Solving, Output):
    """Of `robust convert`."""

    plan: Path = argument(..., "time-triggered plan or log of a planner; - is standard input", "TIMED_PLAN")
    output: Path | None = option(
        None,
        "write the plan here instead of on stdout",
        "--output",
        "-o",
        metavar="PLAN.stn",
        path=True,
        read=plan_file,
    )
    mode: str = option(
        "causal",
        "causal: the least constrained network that is proved valid; esterel: the network of the Esterel transformer",
        choices=("causal", "esterel"),
    )
    stnu: Path | None = option(
        None,
        "also write the network with uncertainty under the box: .stnu or .json by suffix; TIMED_PLAN may be a network "
        "(.stn) then, which is not converted",
        metavar="FILE",
        path=True,
        read=stnu_file,
    )
    box: Path | None = option(
        None,
        "for --stnu: the values that parameters may have, an answer of robust envelope in JSON; else nominal ones",
        metavar="FILE",
        path=True,
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.box is not None and self.stnu is None:
            raise InputError("found it without --stnu, expected it only together", place_of("box"))


class RepairOptions(Separation, Solving):
    """Of :func:`robust.repair`."""

    require: Mapping[str, Number | Interval] | Sequence[str] = option(
        (),
        "values of a parameter for all of which the plan is to be valid, NAME=LOW:HIGH, or NAME=VALUE; others have "
        "their nominal values; may be repeated",
        metavar="NAME=LOW:HIGH",
        many=True,
    )
    change: str = option(
        "bounds",
        "what may change: bounds of the plan's network, nominal values of parameters that are not required, or both",
        choices=("bounds", "nominal", "both"),
    )
    count: bool = option(
        False, "as few changes as possible, and of equally many the least sum; else the least sum of weighted amounts"
    )
    reorder: bool = option(False, "let bounds that say what comes first say the opposite, too")
    on_repair: Callable[[Cost], None] | None = option(None, "called with the cost of each better repair", shown=False)


class RepairCommand(RepairOptions, AskCommand):
    """Of `robust repair`."""

    output: Path | None = option(
        None,
        "write the repaired plan here; PLAN must be a network (.stn) in a file then",
        "--output",
        "-o",
        metavar="PLAN.stn",
        path=True,
        read=plan_file,
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.output is not None and str(self.plan) == "-":
            raise InputError("found a plan on standard input, expected a file to take over", place_of("output"))


class ValidateOptions(Separation, PlanningOutput):
    """Of :func:`robust.validate`."""


class ValidateCommand(ValidateOptions, Output):
    """Of `robust validate`."""

    domain: Path | None = argument(None, "PDDL domain", "DOMAIN")
    problem: Path | None = argument(None, "PDDL problem", "PROBLEM")
    plans: tuple[Path, ...] = argument(
        (), "time-triggered plans or logs of planners; - is standard input", "PLAN", many=True
    )
    suite: Path | None = option(
        None,
        "judge the plans of a file instead: DOMAIN PROBLEM PLAN on each line, relative to the file, # before comments",
        "--list",
        metavar="FILE",
        path=True,
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if (self.suite is None and not self.plans) or (self.suite is not None and self.domain is not None):
            found = "no plan" if self.suite is None else "files beside --list"
            raise InputError(f"found {found}, expected DOMAIN PROBLEM PLAN..., or else --list FILE")


class ExecuteCommand(PlanningOutput, PlanParameters, Separation, Solving, Plot, Planning, Output):
    """Of `robust execute`."""

    plan: Path | None = argument(
        None,
        "network (.stn), time-triggered plan or log of a planner, - is standard input; left out, the planner is asked",
        "PLAN",
    )
    executor: str = option(
        "dreex",
        "dreex: go on while observations are in the box; slice: while something is left of the envelope, with "
        "slice:S up to S seconds to find out; blex:X: while observations are within X per cent",
        metavar="NAME",
    )
    planner: str | None = option(None, "who plans and re-plans: aries, kairos or command:TEMPLATE", metavar="NAME")
    world: Path | None = option(None, "what nature draws, in a TOML file", metavar="FILE", path=True)
    seed: int = option(0, "of the first run; the next ones count up", metavar="N")
    runs: int = option(1, "how many runs", metavar="N")
    method: str = option("widen", "how the box is computed", choices=METHODS)
    controllability: str | None = option(
        None, "use the part of the box that is controllable so", choices=("dynamic", "strong")
    )
    replans: int = option(10, "re-plans after which a run fails", metavar="N")
    planner_limit: Number = option("7", "seconds that the planner has each time", metavar="S", read=seconds)
    planning_time: Number = option(
        "0", "how long re-planning takes in the simulated world", metavar="T", read=not_negative
    )
    stop_running: bool = option(False, "stop running actions to re-plan, instead of waiting for them")

    def check_combinations(self, given: Collection[str]) -> None:
        if self.runs < 1:
            raise InputError(f"found {self.runs}, expected at least 1 run", place_of("runs"))
        if self.replans < 0:
            raise InputError(f"found {self.replans}, expected at least 0 re-plans", place_of("replans"))
        if self.plan is None and self.planner is None:
            raise InputError("found neither PLAN nor --planner, expected one of them: where is the plan to come from?")


WITH_CHOICES = ("execution", "knowledge")
CERTIFICATES = ("plan", "box", "maximal", "region", *WITH_CHOICES)
ASSUMED = "a choice that is made already; may be repeated"


class CertifyCommand(PlanningOutput, PlanParameters, Search, Output):
    """Of `robust certify`; one file is a plan with choices, three are a domain, a problem and a plan."""

    files: tuple[Path, ...] = argument(..., "DOMAIN PROBLEM PLAN, or NETWORK (.tpnu.json)", "FILES", many=True)
    output: Path = option(..., "where to write the certificate", "--output", "-o", metavar="CERT", path=True)
    kind: str | None = option(
        None,
        "plan (default): valid at the nominal values; box: all over a box; maximal: and no valid box contains it; "
        "region: all over the robustness envelope; of a NETWORK execution: this one is correct; knowledge: none is; "
        "if not given, whichever is true",
        choices=CERTIFICATES,
    )
    box: Path | None = option(
        None,
        "the box, an answer of robust envelope in JSON; else widening finds it",
        metavar="FILE",
        path=True,
    )
    assume: tuple[str, ...] = option((), ASSUMED, metavar="NAME=VALUE", many=True)
    alethe: Path | None = option(
        None, "also write cvc5's proofs to DIR, in the Alethe format", metavar="DIR", path=True
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if len(self.files) == 1:
            if self.alethe is not None:
                raise InputError("found --alethe with a plan with choices; expected it with DOMAIN PROBLEM PLAN")
            if self.kind not in {None, *WITH_CHOICES}:
                raise InputError(f"found --kind {self.kind} with a plan with choices; expected execution or knowledge")
            return
        kind = self.kind or "plan"
        if kind in WITH_CHOICES or self.assume:
            found = "--assume" if self.assume else f"--kind {kind}"
            raise InputError(f"found {found} with DOMAIN PROBLEM PLAN; expected it with a plan with choices")
        if kind in {"plan", "region"} and self.box is not None:
            raise InputError(f"found --box with --kind {kind}; expected it with box or maximal")
        if kind == "region" and self.alethe is not None:
            raise InputError("found --alethe with --kind region; expected it with plan, box or maximal")


class VerifyCommand(Separation, Limited, Json):
    """Of `robust verify`."""

    certificate: Path = argument(..., "a certificate", "CERT")
    files: tuple[Path, ...] = argument(..., "DOMAIN PROBLEM PLAN, or NETWORK (.tpnu.json)", "FILES", many=True)
    kind: str | None = option(
        None,
        "fail unless this, or more, is established",
        choices=CERTIFICATES,
    )
    box: Path | None = option(
        None,
        "fail unless all of this box is established: an answer of robust envelope in JSON",
        metavar="FILE",
        path=True,
    )
    assume: tuple[str, ...] = option(
        (),
        "fail unless an execution with this choice is established, or, if it is made already, that there is none",
        metavar="NAME=VALUE",
        many=True,
    )


# -- networks with uncertainty -----------------------------------------------------------------------------------------


class StnuFiles(Limited, Output):
    """Of all of `robust stnu`."""

    files: tuple[Path, ...] = argument(
        ..., "networks: GraphML as the CSTNU tool writes it (.stnu), or JSON", "FILE", many=True
    )


class StnuCheckCommand(StnuFiles):
    """Of `robust stnu check`."""


class StnuDispatchCommand(StnuFiles):
    """Of `robust stnu dispatch`."""

    runs: int = option(1, "how many executions are simulated, as early as possible", metavar="N")
    seed: int = option(0, "which durations the first one draws, uniformly; the next ones count up", metavar="N")

    def check_combinations(self, given: Collection[str]) -> None:
        if self.runs < 0:
            raise InputError(f"found {self.runs}, expected at least 0 runs", place_of("runs"))


def _link_weights(values: Sequence[str], place: Location) -> tuple[tuple[str, Fraction | None], ...]:
    """`NAME=W` each; None is infinite."""
    found = []
    for text in values:
        name, equals, value = text.rpartition("=")
        if not equals or not name:
            expected = "requirement=W, contingent=W or SOURCE:TARGET=W"
            raise InputError(f"found {shorten(text)}, expected {expected}", place)
        found.append((name, None if value == "inf" else positive(value, place)))
    return tuple(found)


class StnuRepairCommand(StnuFiles):
    """Of `robust stnu repair`."""

    weight: tuple[Any, ...] = option(
        (),
        "what a unit of change costs, above 0 or inf: of all links as requirement=W or contingent=W, of one as "
        "SOURCE:TARGET=W; 1 if not given; may be repeated",
        metavar="LINK=W",
        many=True,
        read=_link_weights,
    )
    output: Path | None = option(
        None,
        "write the repaired network here: .stnu or .json by suffix",
        "--output",
        "-o",
        metavar="FILE",
        path=True,
        read=stnu_file,
    )

    def check_combinations(self, given: Collection[str]) -> None:
        if self.output is not None and len(self.files) > 1:
            raise InputError("found several networks, expected one to write", place_of("output"))


class DemoCommand(Options):
    """Of `robust demo`."""
