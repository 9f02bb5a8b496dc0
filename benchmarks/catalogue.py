"""All experiments: names, options, and where the rest of them is. Nothing here is slow to import.

The first paragraph about a class of options is the help of its experiment, the second its line in the list of all. What
is not shown is for callers from Python.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from fractions import Fraction
from importlib import import_module
from inspect import getdoc
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.errors import InputError, Location
from robust.numbers import Number, exact
from robust.options.declare import not_negative, option, positive
from robust.options.shared import Output, Plot

if TYPE_CHECKING:
    from .engine.experiment import Experiment

PROCESSES, LIMITS = 1, 2
"""Ranks: where these options stand in help, after those of the experiment."""
BATTERY = Fraction(520)
"""What the robot of table 2 begins with; the paper does not give its own. Under DREEX it re-plans 0.1 times on average:
about one run in ten leaves the first envelope. The nearer order takes 293 in 14 actions. With 2.5 deviations (16.25)
more for each of them, which makes 520.5, all of them are inside with probability 0.916."""


def _seconds(value: Number, place: Location) -> float:
    return float(min(positive(value, place), Fraction(10) ** 9))


def _path(value: str | Path, _: Location) -> Path:
    return Path(value)


def _whole_numbers(values: tuple[str | int, ...], place: Location) -> tuple[int, ...]:
    for value in values:
        if not str(value).isdecimal():
            raise InputError(f"found {value!r}, expected a whole number", place)
    return tuple(map(int, values))


def _whole_number(value: str | int, place: Location) -> int:
    (number,) = _whole_numbers((value,), place)
    if not number:
        raise InputError(f"found {value!r}, expected a whole number from 1", place)
    return number


def _count(default: int, help: str, metavar: str = "N") -> Any:
    return option(default, help, metavar=metavar)


def _file(default: Any, help: str, metavar: str, rank: int = 0) -> Any:
    return option(default, help, metavar=metavar, path=True, read=_path, rank=rank)


def _limit(default: str | None, help: str, *names: str, rank: int = LIMITS) -> Any:
    return option(default, help, *names, metavar="S", read=_seconds, rank=rank)


def _many(help: str, name: str, metavar: str, read: Any = None) -> Any:
    return option((), f"{help}; may be repeated", name, metavar=metavar, many=True, read=read)


def _inner(default: Any, help: str) -> Any:
    return option(default, help, shown=False)


_KILLED = "seconds after which an instance is killed"


class LocalOptions(Output):
    """Of all experiments."""

    jobs: int = option(1, "processes at a time; more than 1 disturbs timings", metavar="N", rank=PROCESSES)


class LongOptions(LocalOptions):
    """Of those that can be resumed, and can run on a cluster."""

    cluster: str | None = option(
        None, "run on the workers of this Dask scheduler (extra cluster)", metavar="ADDRESS", rank=PROCESSES
    )
    store: Path | None = _file(None, "keep results as they arrive; a run with the same FILE resumes", "FILE", PROCESSES)


class SuiteOptions(LocalOptions, Plot):
    """Of those about a data set."""

    suite: Path = _file(..., "the data set", "DIR")
    limit: float | None = _limit(None, _KILLED)


class RecordedOptions(SuiteOptions):
    """Run a data set and compare boxes and numbers of checks with the recorded ones.

    Compare with recorded runs.
    """

    instances: int | None = option(None, "only N instances, spread over the data set", metavar="N", read=_whole_number)


class ScalingOptions(LocalOptions, Plot):
    """Time over size: generated plans with more and more actions and parameters.

    Time over the size of a plan.
    """

    limit: float | None = _limit(None, _KILLED)
    series: tuple[Any, ...] = _inner((), "which plans; without, all")


class Figure3Options(RecordedOptions):
    """Run a data set by every method: how many instances are solved within which time, beside the recorded runs.

    Instances solved over time, by every method.
    """

    limit: float | None = _limit("10", _KILLED)
    own_limits: Mapping[str, float] = _inner({}, "other limits for some contenders, by name")
    contenders: tuple[Any, ...] | None = _inner(None, "what is run; without, everything")

    def check_combinations(self, given: Collection[str]) -> None:
        for name, seconds in self.own_limits.items():
            _seconds(seconds, Location(f"own_limits {name}"))


class Figure5Options(RecordedOptions):
    """Run IRR on a data set: how near the final box is after how many steps.

    Convergence of IRR by steps.
    """

    limit: float | None = _limit("10", _KILLED)
    schedules: tuple[Any, ...] = _inner((), "without, both")


class BackendsOptions(ScalingOptions):
    """Time over size: each elimination back end on plans with more and more parameters and unordered time points.

    Time of each elimination back end over size.
    """

    limit: float | None = _limit("10", _KILLED)
    contenders: tuple[Any, ...] | None = _inner(None, "what is run; without, everything")


class EncodingsOptions(BackendsOptions):
    """Time over size: both encodings on plans with more and more unordered time points.

    Time of both encodings over size.
    """


class WideningOptions(BackendsOptions):
    """Time of IRR and of exact widening on plans with many parameters, and the share of the solver.

    Exact widening beside IRR on plans with many parameters.
    """

    limit: float | None = _limit("120", _KILLED)


class Figure4Options(LongOptions, Plot):
    """Run every method on delivery plans of 1 to 33 parameters, and ask whether the boxes are controllable.

    Time over the parameters of delivery plans, by every method.
    """

    suite: Path | None = _file(None, "a data set with recorded plans", "DIR")
    limit: float | None = _limit("10", _KILLED)
    baseline_limit: float | None = _limit("10", "the same for all but IRR and exact widening")
    sizes: tuple[int, ...] | None = option(
        None,
        "of our own plans only those of N parameters, else those of 1 to 33; may be repeated",
        "--parameters",
        metavar="N",
        many=True,
        read=_whole_numbers,
    )
    seed: int = _inner(0, "which they are")
    contenders: tuple[Any, ...] | None = _inner(None, "what is run, all if None")


class ConversionOptions(LongOptions):
    """Convert time-triggered plans, and remove each constraint in turn: is the plan still proved valid without it?

    Converted plans: proved, and what they could do without.
    """

    drawn: int = _count(150, "how many plans are drawn at random")
    delivery: int = _count(50, "how many delivery plans")
    planned: int = _count(100, "how many plans a planner makes")
    planner: str = option("aries", "which planner", metavar="NAME")
    seed: int = _count(0, "which plans and problems")
    limit: float | None = _limit("60", "seconds to convert a plan, and as many to judge it")


class LogsOptions(SuiteOptions):
    """Convert and check what planners printed, as whole processes, beside VAL.

    Logs of planners: time and memory over the number of steps.
    """

    validator: Path | None = _file(None, "VAL's program Validate, which is left out without it", "FILE")


class TableOptions(LongOptions):
    """Execute delivery plans: coverage and re-plans, and the paper's."""

    problems: int = _count(100, "how many of the hundred problems")
    runs: int = _count(1, "simulated worlds for each problem")
    columns: tuple[int, ...] = _inner((), "numbers of uncertain durations; without, all")
    planner: str | None = option(None, "who plans; else aries for table 1, kairos for table 2", metavar="NAME")
    planner_limit: float = _limit("7", "seconds for each plan", rank=0)
    drain: bool | None = option(
        None,
        "wait for what runs when a plan is given up (else for table 2), or stop it (for table 1)",
        "--drain/--stop",
    )
    battery: Fraction | None = _inner(None, "the charge at the beginning, BATTERY if None")
    seed: int = _count(0, "which simulated worlds")
    executors: tuple[str, ...] = _inner((), "which, DREEX first; without, all")


class StnuOptions(LocalOptions, Plot):
    """Judge, dispatch and repair networks with uncertainty of 50 to 2,000 time points, in one process.

    Time over the size of networks with uncertainty.
    """

    networks: int = _count(10, "how many networks of each size")
    seed: int = _count(0, "which networks")
    sizes: tuple[int, ...] = _inner((50, 100, 200, 500, 1000, 2000), "numbers of time points")
    limit: float | None = _limit("10", "seconds after which a repair is the best so far")


class EnvelopeOptions(LocalOptions):
    """Regions and boxes of plans with choices: the stories, and random plans beside the oracle, in one process.

    Polyhedra and times of envelopes of plans with choices.
    """

    plans: int = _count(100, "how many random plans")
    points: int = _inner(20, "values of the parameters of each random plan at which the oracle is asked")
    every: int = _inner(1, "only each so manieth question about the stories")
    seed: int = _count(0, "which random plans")
    limit: float | None = _limit("60", "seconds after which a question is out of time")


class RiskOptions(LocalOptions, Plot):
    """Bound the probability that plans with random durations succeed: deliveries with 1 to 8 of them, beside random
    points, and with every duration random job shops and, with --logs, what planners printed; with --suite, what boxes
    and octagons keep.

    Probabilities of success: time and width over the number of random durations.
    """

    plans: int = _count(5, "how many deliveries of each size")
    shops: int = _count(1, "how many job shops of each size")
    logs: Path | None = _file(None, "a data set of planners' logs: a directory with plans.json", "DIR")
    suite: Path | None = _file(None, "a data set with recorded plans, of which those with 2 to 4 parameters", "DIR")
    seed: int = _count(0, "which plans")
    draws: int = _count(100_000, "random points of each delivery with up to 4 parameters")
    within: Number = option("0.001", "how close bounds are to be", metavar="W", read=positive)
    sizes: tuple[int, ...] = _inner(tuple(range(1, 9)), "numbers of parameters of deliveries")
    parts: tuple[int, ...] = _inner((2, 4, 8, 16), "numbers of parts, with three durations each, of job shops")
    limit: float | None = _limit("60", "seconds after which bounds are what is known")


class Table1Options(TableOptions):
    """Execute delivery plans whose durations are uncertain: coverage and re-plans, and the paper's.

    Executors under uncertain durations.
    """

    columns: tuple[int, ...] = _many(
        "only with N uncertain durations, 1 to 5; 6 is every action", "--parameters", "N", read=_whole_numbers
    )


class Table2Options(TableOptions):
    """Execute delivery plans whose consumption is uncertain: coverage and re-plans, and the paper's.

    Executors under uncertain consumption.
    """

    battery: Fraction | None = option(None, "the charge at the beginning; else 520", metavar="B", read=exact)


class MonitoredOptions(LongOptions):
    """Execute delivery plans whose consumption is uncertain by what a monitor says, and by DREEX: successes, re-plans,
    and how long the monitor's answers take.

    A monitor in the worlds of table 2.
    """

    problems: int = _count(4, "how many of the hundred problems of table 2")
    planner_limit: float = _limit("7", "seconds for each plan", rank=0)
    battery: Fraction = option(BATTERY, "the charge at the beginning", metavar="B", read=exact)
    seed: int = _count(0, "which simulated world")


class Figure21Options(LongOptions, Plot):
    """Compile random plans with choices: the number of prime implicants over that of models.

    Prime implicants beside models of plans with choices.
    """

    instances: int = _count(500, "how many random plans")
    seed: int = _count(0, "which random plans")
    feasible: bool = option(False, "large plans that are feasible in many ways, instead of the paper's")
    backends: tuple[str, ...] = _inner(("pitms",), "who counts implicants")
    limit: float | None = _limit("60", _KILLED)


class Figure20aOptions(Figure21Options):
    """Compile random plans with choices: time over the number of candidate subplans, for every back end.

    Compilation of plans with choices, by every back end.
    """

    backends: tuple[str, ...] = _many("only this one of those in the table", "--backend", "NAME")


class Figure20bOptions(LongOptions, Plot):
    """Execute the random plans with choices that admit it: how long each back end takes to decide.

    Latency of executions of plans with choices, by every back end.
    """

    problems: int = _count(500, "how many random plans, of which some can be executed")
    seed: int = _count(0, "which random plans")
    backends: tuple[str, ...] = _many("only this one of smt, pitms, atms, bdd and sat", "--backend", "NAME")
    delay: Number = option("0", "humans hesitate this long at most", metavar="T", read=not_negative)
    patient: bool = option(False, "wait for what humans may still choose, which the paper does not")
    limit: float = _limit("60", "seconds for each compilation and execution", "--timeout", "--limit")


class HesitationOptions(LongOptions):
    """Execute plans with choices with humans who hesitate: who waits for them, who does not, and who knew.

    Executions of plans with choices with humans who hesitate.
    """

    problems: int = _count(500, "how many random plans, of which some can be executed")
    seed: int = _count(0, "which random plans")
    stories: tuple[str, ...] | None = _inner(None, "which plans with names; without, all")
    limit: float | None = _limit("60", "seconds for each execution")


class StepsOptions(LongOptions):
    """Execute large plans with choices: how long each step takes, and what its budget gives away.

    Steps of executions of large plans with choices.
    """

    blocks: tuple[int, ...] = _many(
        "plans of N blocks of 13 activities; 4, 8, 16 and 31", "--blocks", "N", read=_whole_numbers
    )
    seed: int = _count(0, "of what people choose, and how long activities take")
    limit: float | None = _limit("120", "seconds for each execution")


class StrategiesOptions(LongOptions):
    """Decide whether plans with choices are controllable, and execute them as the strategy says.

    Controllability of plans with choices.
    """

    plans: tuple[str, ...] = _many(
        "only these plans; kitchen, wing, and blocks-N for N = 1, 4, 8 and 16", "--plan", "NAME"
    )
    runs: int = _count(100, "how often each controllable plan is executed")
    limit: float | None = _limit("300", "seconds for each verdict")


class RatesOptions(LongOptions):
    """Carry plans with choices out by PIKE, Kirk and Drake: how often each succeeds with the same people.

    Success of executives with the same people.
    """

    plans: tuple[str, ...] = _many("only these plans; kitchen, wing, k-intents 3,3 and 2 blocks", "--plan", "NAME")
    runs: int = _count(100, "how often each plan is carried out")
    seed: int = _count(0, "of what people mean, and how long activities take")
    limit: float | None = _limit("60", "seconds to compute an execution")


class Figure17Options(LongOptions, Plot):
    """Execute plans with choices by PIKE, and by one who guesses intents: re-plans over the number of intents.

    Re-plans of an executive that guesses what humans intend.
    """

    problems: int = _count(2000, "how many random problems")
    seed: int = _count(0, "which random plans")
    largest: int = _count(10_000, "how many intents a problem has at most", "K")
    reasoner: str = option("smt", "how both executives reason", "--backend", metavar="NAME")
    limit: float | None = _limit("60", "seconds to compute an execution")


class Figure18Options(Figure17Options):
    """Execute plans with choices by PIKE, and by one who guesses intents: the times until all is done.

    Time to completion of an executive that guesses what humans intend.
    """


@dataclass(frozen=True, slots=True)
class Entry:
    """An experiment that is not loaded: the constant of its name in the module at `place`."""

    name: str
    place: str
    options: type

    @property
    def help(self) -> str:
        """What it does, as help shows it."""
        return (getdoc(self.options) or "").split("\n\n")[0]

    @property
    def summary(self) -> str:
        """The same in one line of a list."""
        return (getdoc(self.options) or "").split("\n\n")[1]

    def load(self) -> Experiment:
        """The experiment itself, with everything that it needs."""
        found: Experiment = getattr(import_module(f".{self.place}", __package__), self.name.upper())
        return found


EXPERIMENTS = {
    entry.name: entry
    for entry in (
        Entry("recorded", "irr.recorded", RecordedOptions),
        Entry("scaling", "irr.growth", ScalingOptions),
        Entry("figure3", "irr.figure3", Figure3Options),
        Entry("figure5", "irr.figure5", Figure5Options),
        Entry("backends", "irr.growth", BackendsOptions),
        Entry("encodings", "irr.growth", EncodingsOptions),
        Entry("widening", "irr.growth", WideningOptions),
        Entry("figure4", "irr.figure4", Figure4Options),
        Entry("conversions", "irr.conversions", ConversionOptions),
        Entry("logs", "irr.logs", LogsOptions),
        Entry("stnu", "irr.stnu", StnuOptions),
        Entry("envelopes", "pike.envelopes", EnvelopeOptions),
        Entry("risk", "irr.risk", RiskOptions),
        Entry("table1", "irr.tables", Table1Options),
        Entry("table2", "irr.tables", Table2Options),
        Entry("monitored", "irr.monitored", MonitoredOptions),
        Entry("figure20a", "pike.figure20a_21", Figure20aOptions),
        Entry("figure20b", "pike.figure20b", Figure20bOptions),
        Entry("hesitation", "pike.hesitation", HesitationOptions),
        Entry("steps", "pike.steps", StepsOptions),
        Entry("rates", "pike.rates", RatesOptions),
        Entry("strategies", "pike.strategies", StrategiesOptions),
        Entry("figure21", "pike.figure20a_21", Figure21Options),
        Entry("figure17", "pike.figure17_18", Figure17Options),
        Entry("figure18", "pike.figure17_18", Figure18Options),
    )
}
