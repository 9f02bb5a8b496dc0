"""`robust bench figure4`: the time of each method over the number of parameters, in the delivery domain [IRR Fig. 4].

Every run of a method is a whole process with a limit of its own. The plans are those that a data set records, if there
is one, and our own of one parameter after another. For each plan it is also asked whether the box of exact widening is
dynamically controllable, and how much of it is lost by making it so.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

from robust.api import envelope
from robust.errors import InputError, Location, RobustError
from robust.execute.controllability.assess import Controllability, Kind
from robust.execute.convert import convert
from robust.execute.parametrization import option_of
from robust.plan.load import load_plan
from robust.plan.model import ActionInstance, Duration, ParameterReference, ParametrizedPlan, Relation
from robust.plan.parameters import parse_specs
from robust.plan.pddl.forms import read_text
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.stn import write_stn
from robust.plan.timed import parse_timed_plan
from robust.qe.box import Box, Side
from robust.smt.limits import Deadline, OutOfTimeError

from ..catalogue import Figure4Options
from ..engine.experiment import Experiment, Report, Results
from ..engine.measure import COST, FAILURES, Ending, Ends, Files, box_of
from ..engine.show import NOTHING, OTHER, STYLES, Cells, Table, canvas, legend_below, number, seconds_axis
from ..generators.delivery import scaling_instance
from .contenders import BASELINE, BY_NAME, OURS, Contender

LIST = Path("robot-delivery", "instances.json")
CONTENDERS = OURS + BASELINE
CONTROLLABILITY = "controllability"
_MARKS = (1.0, 2.0, 5.0, 10.0, 60.0, 3600.0)


class Origin(Enum):
    """Whose plans they are."""

    RECORDED = "recorded"
    OWN = "own"


# -- plans -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class DeliveryInstance:
    """A plan by its texts, so that it can be sent to another machine; `options` are what the plan file cannot say."""

    name: str
    origin: Origin
    parameters: int
    texts: tuple[str, str, str]
    options: tuple[str, ...] = ()

    def write(self, directory: Path) -> Files:
        """Write domain, problem and plan into a directory."""
        paths = (directory / "domain.pddl", directory / "problem.pddl", directory / "plan.stn")
        for path, text in zip(paths, self.texts, strict=True):
            path.write_text(text, encoding="utf-8")
        return paths


def recorded_instances(suite: Path) -> tuple[DeliveryInstance, ...]:
    """The plans that `robot-delivery/instances.json` of a data set lists.

    Raises:
        InputError: if the list or a file that it names is missing or malformed.
    """
    path = suite / LIST
    location = Location(str(path))
    try:
        entries = json.loads(read_text(path))
    except ValueError as error:
        raise InputError(f"not JSON: {error}", location) from None
    if not isinstance(entries, list) or not entries:
        raise InputError("expected a list of at least one instance", location)
    return tuple(_recorded(suite, entry, place, location) for place, entry in enumerate(entries, 1))


def _recorded(suite: Path, entry: object, place: int, location: Location) -> DeliveryInstance:
    values: dict[str, Any] = entry if isinstance(entry, dict) else {}
    name, *files = [str(values.get(key) or "") for key in ("instance", "domain", "problem", "plan")]
    parameters = values.get("parameters")
    if not name or not all(files) or type(parameters) is not int:
        expected = "'instance', 'domain', 'problem' and 'plan' as texts and 'parameters' as a number"
        raise InputError(f"entry {place}: expected an object with {expected}", location)
    domain, problem, plan = (read_text(suite / file) for file in files)
    return DeliveryInstance(name, Origin.RECORDED, parameters, (domain, problem, plan))


def own_instance(parameters: int, seed: int) -> DeliveryInstance:
    """A generated plan of the delivery domain, converted to its least constrained network."""
    made = scaling_instance(parameters, seed)
    domain = parse_domain(made.domain)
    problem, timed = parse_problem(made.problem, domain), parse_timed_plan(made.plan)
    conversion = convert(domain, problem, timed, specs=parse_specs(made.specs))
    found = len(conversion.plan.parameters)
    if found != parameters:
        raise ValueError(f"the instance has {found} parameters, expected {parameters}")
    options = tuple(f"--parameter={option_of(one)}" for one in conversion.beside)
    texts = (made.domain, made.problem, write_stn(conversion.stn))
    return DeliveryInstance(f"own_{parameters:02}_{seed}", Origin.OWN, parameters, texts, options)


# -- one method on one plan --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Figure4Task:
    """A method by its name, or CONTROLLABILITY, on one plan; `limit` in seconds."""

    instance: DeliveryInstance
    method: str
    limit: float | None

    @property
    def label(self) -> str:
        return f"{self.instance.name}, {self.method}"


@dataclass(frozen=True)
class MethodRun:
    """One method on one plan: what it cost, and what it found.

    Of a box, `unbounded` are the directions in which it has no end, and `capped` are those that nothing but the number
    in the duration constraint of an action ends: `above a`, `below b`.
    """

    status: Ending
    seconds: float
    cpu_s: float
    memory_mb: float
    search_s: float | None
    message: str | None
    box: dict[str, Ends] | None = None
    unbounded: tuple[str, ...] = ()
    capped: tuple[str, ...] = ()
    polyhedra: int | None = None


@dataclass(frozen=True, slots=True)
class Assessment:
    """Controllability of the box of exact widening, and what is left of it once it is dynamically controllable.

    Of finite widths the share `kept` is left, on average; `bounded` counts faces that were infinite and are not any
    more, without those in `cut`: these may be at any finite place, so that nothing was lost.
    """

    status: str
    dynamic: str | None = None
    strong: str | None = None
    kept: float | None = None
    bounded: int | None = None
    cut: int | None = None
    reason: str | None = None


@dataclass(frozen=True, slots=True)
class Found:
    """What came of a task: one of both."""

    run: MethodRun | None = None
    assessment: Assessment | None = None


def do(task: Figure4Task) -> Found:
    """Run a method as a whole process, or ask about controllability in this one.

    Raises:
        RobustError: if the plan cannot be read.
    """
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        files, options = task.instance.write(Path(directory)), task.instance.options
        if task.method == CONTROLLABILITY:
            return Found(assessment=_assessment(_plan(files, options), task.limit))
        run = BY_NAME[task.method].run(files, limit=task.limit, extra=options)
        found = MethodRun(**{name: getattr(run, name) for name in COST}, polyhedra=run.polyhedra)
        if run.box:
            box = box_of(run.box)
            capped = only_capped(_plan(files, options), box)
            found = replace(found, box=run.box, unbounded=unbounded(box), capped=capped)
        return Found(found)


def _plan(files: Files, options: tuple[str, ...]) -> ParametrizedPlan:
    return load_plan(*files, parameters=[one.removeprefix("--parameter=") for one in options])


def unbounded(box: Box) -> tuple[str, ...]:
    """The directions in which a box has no end."""
    above = [f"above {name}" for name, interval in box.intervals.items() if interval.upper is None]
    return (*above, *(f"below {name}" for name, interval in box.intervals.items() if interval.lower is None))


def only_capped(plan: ParametrizedPlan, box: Box) -> tuple[str, ...]:
    """Parameters that are durations, and that nothing but a number in their own duration constraint bounds above."""
    caps: dict[str, set[Fraction]] = {}
    for constraint in plan.constraints:
        instance = plan.instance.get(constraint.target.instance or "")
        if instance is None or constraint.source.instance != instance.identifier or constraint.lower is None:
            continue
        for name in box.intervals:
            if constraint.lower == constraint.upper == Polynomial.variable(ParameterReference(name)):
                caps.setdefault(name, set()).update(_greatest_durations(instance))
    return tuple(f"above {name}" for name, values in caps.items() if values and box[name].upper == min(values))


def _greatest_durations(instance: ActionInstance) -> Iterator[Fraction]:
    """The numbers in constraints `(<= ?duration number)`, which are kept as `number − ?duration ≥ 0`."""
    for part in instance.durations:
        expression = part.condition.expression
        constant = expression.constant_term
        shape = Polynomial.constant(constant) - Polynomial.variable(Duration())
        if part.condition.relation is Relation.AT_LEAST and expression == shape:
            yield constant


def _assessment(plan: ParametrizedPlan, limit: float | None) -> Assessment:
    deadline = Deadline.after(limit)
    found = envelope(plan, timeout=limit)
    facts = Assessment(found.status.value)
    if not found.verified:
        return replace(facts, reason=found.reason)
    try:
        questions = Controllability(plan, found.box, deadline=deadline)
        dynamic, strong = questions.finding(Kind.DYNAMIC), questions.finding(Kind.STRONG)
        facts = replace(facts, dynamic=dynamic.verdict.value, strong=strong.verdict.value, reason=dynamic.reason)
        shrunk = questions.shrunk(Kind.DYNAMIC)
    except OutOfTimeError:
        return replace(facts, status="timeout")
    except RobustError as error:
        return replace(facts, reason=str(error))
    return replace(facts, **loss(found.box, shrunk.box, {name for name, side in shrunk.cut if side is Side.UPPER}))


def loss(box: Box, part: Box, cut: set[str]) -> dict[str, Any]:
    """What is `kept`, `bounded` and `cut`, see :class:`Assessment`."""
    shares = []
    bounded = 0
    for name, interval in box.intervals.items():
        width, left = interval.width, part.intervals[name].width
        if width is not None and width > 0:
            shares.append((left or Fraction(0)) / width)
        elif width is None and left is not None and name not in cut:
            bounded += 1
    return {
        "kept": round(float(sum(shares) / len(shares)), 4) if shares else None,
        "bounded": bounded,
        "cut": len(cut),
    }


# -- the report --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Figure4Row:
    """One plan: its runs by the names of the methods, and what was found about controllability."""

    instance: str
    origin: Origin
    parameters: int
    runs: Mapping[str, MethodRun]
    controllability: Assessment | None

    def seconds(self, method: str) -> float | None:
        """The time of a run that came to an end by itself."""
        run = self.runs.get(method)
        return run.seconds if run is not None and run.status is Ending.COMPLETE else None

    def time(self, method: str) -> str:
        """The same as text, or how the run ended."""
        run = self.runs.get(method)
        if run is None:
            return NOTHING
        return number(run.seconds) if run.status is Ending.COMPLETE else run.status.value

    @property
    def unbounded(self) -> str:
        """Directions in which the widened box has no end, and those that only a number in the domain ends."""
        run = self.runs.get("widen")
        if run is None or run.box is None:
            return NOTHING
        return f"{len(run.unbounded)} + {len(run.capped)} of {2 * len(run.box)}"

    @property
    def assessed(self) -> Cells:
        """Dynamically and strongly controllable or not, what is kept, and how many faces are bounded."""
        found = self.controllability
        assert found is not None  # noqa: S101 - only such rows are asked
        kept = NOTHING if found.kept is None else f"{100 * found.kept:.1f} %"
        bounded = NOTHING if found.bounded is None else str(found.bounded)
        return found.dynamic or found.status, found.strong or NOTHING, kept, bounded


class Figure4Report(Report[Figure4Row]):
    """All plans, by origin and number of parameters."""

    SETTINGS: ClassVar[Mapping[str, str]] = {
        "limit_s": "limit",
        "baseline_limit_s": "baseline_limit",
        "jobs": "jobs",
    }
    ROW = Figure4Row

    @property
    def contenders(self) -> tuple[Contender, ...]:
        chosen: tuple[Contender, ...] | None = self.options.contenders
        return CONTENDERS if chosen is None else chosen

    @classmethod
    def read_options(cls, answer: Mapping[str, Any]) -> dict[str, Any]:
        methods = {name for one in answer["solved"] for name in one["methods"]}
        return {**super().read_options(answer), "contenders": tuple(one for one in CONTENDERS if one.name in methods)}

    @property
    def origins(self) -> tuple[Origin, ...]:
        return tuple(dict.fromkeys(row.origin for row in self.rows))

    def rows_of(self, origin: Origin) -> list[Figure4Row]:
        return [row for row in self.rows if row.origin is origin]

    def times(self, origin: Origin, method: str) -> list[float]:
        """Of the runs that came to an end by themselves."""
        return [time for row in self.rows_of(origin) if (time := row.seconds(method)) is not None]

    @property
    def wrong(self) -> list[str]:
        """Runs that ended in an error."""
        return [
            f"{row.instance}, {name}: {run.status.value}: {run.message}"
            for row in self.rows
            for name, run in row.runs.items()
            if run.status in FAILURES
        ]

    @property
    def agrees(self) -> bool:
        """Whether all was run, nothing failed, and IRR and exact widening solved every plan within their limit."""
        ours = [one.name for one in self.contenders if one in OURS]
        solved = all(row.seconds(name) is not None for row in self.rows for name in ours)
        return self.complete and not self.failures and not self.wrong and solved

    @property
    def notes(self) -> tuple[str, ...]:
        limits = [self.options.limit, self.options.baseline_limit]
        ours, others = ("none" if limit is None else f"{limit:g} s" for limit in limits)
        notes = [f"whole processes on this machine; limits: IRR and widening {ours}, the others {others}"]
        return (*notes, *self.jobs_notes, *self.wrong, *self.sweep_notes)

    @property
    def findings(self) -> Mapping[str, Any]:
        solved = [
            {
                "origin": origin.value,
                "plans": len(self.rows_of(origin)),
                "methods": {one.name: len(self.times(origin, one.name)) for one in self.contenders},
            }
            for origin in self.origins
        ]
        return {"solved": solved}

    @property
    def tables(self) -> list[Table]:
        """Times of every plan, how many each method solves, and controllability."""
        times: list[Cells | None] = []
        solved: list[Cells | None] = []
        limits = [limit for limit in (self.options.limit, self.options.baseline_limit) if limit is not None]
        marks = [mark for mark in _MARKS if not limits or mark <= max(limits)]
        for origin in self.origins:
            rows = self.rows_of(origin)
            for row in rows:
                cells = (row.time(contender.name) for contender in self.contenders)
                times.append((row.instance, str(row.parameters), *cells, row.unbounded))
            for contender in self.contenders:
                found = self.times(origin, contender.name)
                counts = (str(sum(time <= mark for time in found)) for mark in marks)
                solved.append(
                    (f"{origin.value}: {len(rows)}", contender.label, *counts, number(max(found, default=None)))
                )
            times.append(None)
            solved.append(None)
        headings = ("plan", "parameters", *(contender.name for contender in self.contenders), "unbounded + capped")
        assessed = [row for row in self.rows if row.controllability is not None]
        return [
            Table("Seconds by plan", headings, times, self.notes),
            Table(
                "Plans solved within",
                ("plans", "method", *(f"{mark:g} s" for mark in marks), "longest"),
                solved,
                align="<<>",
                whole=False,
            ),
            Table(
                "Controllability of the widened box",
                ("plan", "parameters", "dynamically", "strongly", "width kept", "faces bounded"),
                [(row.instance, str(row.parameters), *row.assessed) for row in assessed],
                whole=False,
            ),
        ]

    def draw(self, path: Path) -> None:
        """One panel for the recorded plans and one for ours: the time of every run over the number of parameters."""
        origins = self.origins
        with canvas(path, 5.2 * len(origins), 5, len(origins)) as (figure, panels):
            for axes, origin in zip(panels, origins, strict=True):
                rows = sorted(self.rows_of(origin), key=lambda row: row.parameters)
                for one in self.contenders:
                    colour, _, marker = STYLES.get(one.name, OTHER)
                    runs = [(row.parameters, row.runs[one.name]) for row in rows if one.name in row.runs]
                    done = [(size, run.seconds) for size, run in runs if run.status is Ending.COMPLETE]
                    late = [(size, run.seconds) for size, run in runs if run.status is Ending.TIMEOUT]
                    label = f"{one.label}: {len(done)} of {len(rows)}" if len(origins) == 1 else one.label
                    axes.plot([], [], marker=marker, color=colour, linestyle="none", markersize=5, label=label)
                    if done:
                        axes.plot(*zip(*done, strict=True), marker, color=colour, markersize=4, alpha=0.85)
                    if late:
                        axes.plot(*zip(*late, strict=True), "x", color=colour, markersize=6, clip_on=False)
                seconds_axis(axes)
                axes.set_xlabel("parameters (×: out of time)")
                axes.set_title(f"{origin.value} plans: {len(rows)}", fontsize=9, loc="left")
            panels[0].set_ylabel("time")
            legend_below(figure, panels[:1], 4)


def _prepare(options: Figure4Options, _: object) -> tuple[DeliveryInstance, ...]:
    recorded = () if options.suite is None else recorded_instances(options.suite)
    instances = (*recorded, *(own_instance(size, options.seed) for size in options.sizes))
    if not instances:
        raise InputError("found no plan, expected a data set or sizes")
    return instances


def _tasks(options: Figure4Options, instances: tuple[DeliveryInstance, ...]) -> list[Figure4Task]:
    contenders = CONTENDERS if options.contenders is None else options.contenders
    baseline = {one.name for one in BASELINE}
    return [
        Figure4Task(instance, name, options.baseline_limit if name in baseline else options.limit)
        for instance in instances
        for name in (*(one.name for one in contenders), CONTROLLABILITY)
    ]


def _rows(_: Figure4Options, instances: tuple[DeliveryInstance, ...], results: Results) -> list[Figure4Row]:
    runs: dict[str, dict[str, MethodRun]] = {}
    assessments: dict[str, Assessment] = {}
    for task, found in results:
        of_plan = runs.setdefault(task.instance.name, {})
        if found.run is not None:
            of_plan[task.method] = found.run
        if found.assessment is not None:
            assessments[task.instance.name] = found.assessment
    return [
        Figure4Row(one.name, one.origin, one.parameters, runs[one.name], assessments.get(one.name))
        for one in instances
        if one.name in runs
    ]


def _describe(task: Figure4Task, found: Found) -> str:
    if found.assessment is not None:
        return f"{task.label}: {found.assessment.dynamic or found.assessment.status}"
    assert found.run is not None  # noqa: S101 - one of both
    return f"{task.label}: {found.run.status.value}, {found.run.seconds:.2f} s"


FIGURE4 = Experiment(
    "figure4",
    Figure4Options,
    _tasks,
    do,
    Found,
    Figure4Report,
    _describe,
    prepare=_prepare,
    collect=_rows,
    lenient=True,
)
