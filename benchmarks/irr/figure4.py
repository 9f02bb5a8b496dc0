"""`robust bench figure4`: the time of each method over the number of parameters, in the delivery domain [IRR Fig. 4].

Every run of a method is a whole process with a limit of its own. The plans are those that a data set records, if there
is one, and our own of one parameter after another. For each plan it is also asked whether the box of exact widening is
dynamically controllable, and how much of it is lost by making it so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from pathlib import Path
from statistics import mean
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

from robust.api import envelope
from robust.errors import InputError, RobustError
from robust.execute.controllability import Control, Controllability
from robust.execute.convert import Settings, convert
from robust.execute.parametrization import option_of
from robust.plan.model import ActionInstance, Duration, ParameterReference, ParametrizedPlan, Relation
from robust.plan.parameters import parse_specs
from robust.plan.pddl.forms import read_text
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.stn import write_stn
from robust.plan.timed import parse_timed_plan
from robust.qe.box import Box, Side
from robust.reading import load_plan
from robust.smt.limits import Deadline, OutOfTimeError
from robust.sweeps.batch import box_of

from ..catalogue import Figure4Options
from ..engine.experiment import Experiment, Results, Task
from ..engine.measure import COST, Ending, Files, Run, write_files
from ..engine.show import NOTHING, OTHER, STYLES, Columns, Panel, Series, Table, family, number
from ..generators.delivery import scaling_instance
from ..suite import read_deliveries
from .contenders import BASELINE, MARKS, OURS, Contender, MethodsReport, by_instance, limits_text

CONTENDERS = OURS + BASELINE
CONTROLLABILITY = Contender("controllability", "controllability", "", ())
"""Not a way to an envelope: what is asked about the box of exact widening."""


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
        return write_files(directory, self.texts)


def recorded_instances(suite: Path) -> tuple[DeliveryInstance, ...]:
    """The plans of the delivery domain in a data set.

    Raises:
        InputError: if there are none, or a file is missing or malformed.
    """
    return tuple(
        DeliveryInstance(one.instance, Origin.RECORDED, one.parameters, (read_text(a), read_text(b), read_text(c)))
        for one, (a, b, c) in read_deliveries(suite)
    )


def own_instance(parameters: int, seed: int) -> DeliveryInstance:
    """A generated plan of the delivery domain, converted to its least constrained network."""
    made = scaling_instance(parameters, seed)
    domain = parse_domain(made.domain)
    problem, timed = parse_problem(made.problem, domain), parse_timed_plan(made.plan)
    conversion = convert(domain, problem, timed, Settings(specs=parse_specs(made.specs)))
    found = len(conversion.plan.parameters)
    if found != parameters:
        raise ValueError(f"the instance has {found} parameters, expected {parameters}")
    options = tuple(f"--parameter={option_of(one)}" for one in conversion.beside)
    texts = (made.domain, made.problem, write_stn(conversion.stn))
    return DeliveryInstance(f"own_{parameters:02}_{seed}", Origin.OWN, parameters, texts, options)


# -- one method on one plan --------------------------------------------------------------------------------------------


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

    run: Run | None = None
    assessment: Assessment | None = None

    def __str__(self) -> str:
        if self.run is not None:
            return f"{self.run.status.value}, {self.run.cpu_s:.2f} s"
        return "nothing" if self.assessment is None else self.assessment.dynamic or self.assessment.status


def do(instance: DeliveryInstance, method: Contender, limit: float | None) -> Found:
    """Run a method as a whole process, or ask about controllability in this one.

    Raises:
        RobustError: if the plan cannot be read.
    """
    with TemporaryDirectory(prefix="robust-bench-") as directory:
        files, options = instance.write(Path(directory)), instance.options
        if method == CONTROLLABILITY:
            return Found(assessment=_assessment(_plan(files, options), limit))
        made = method.run(files, limit=limit, extra=options)
        run = Run(**{name: getattr(made, name) for name in (*COST, "box", "polyhedra")})
        if run.box:
            box = box_of(run.box)
            run = replace(run, unbounded=unbounded(box), capped=only_capped(_plan(files, options), box))
        return Found(run)


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
        constant = part.condition.expression.constant_term
        shape = Polynomial.constant(constant) - Polynomial.variable(Duration())
        if (part.condition.relation, part.condition.expression) == (Relation.AT_LEAST, shape):
            yield constant


def _assessment(plan: ParametrizedPlan, limit: float | None) -> Assessment:
    deadline = Deadline.after(limit)
    found = envelope(plan, timeout=limit)
    facts = Assessment(found.status.value, reason=found.reason)
    if not found.verified:
        return facts
    try:
        questions = Controllability(plan, found.box, deadline=deadline)
        dynamic, strong = questions.finding(Control.DYNAMIC), questions.finding(Control.STRONG)
        facts = replace(facts, dynamic=dynamic.verdict.value, strong=strong.verdict.value, reason=dynamic.reason)
        shrunk = questions.shrunk(Control.DYNAMIC)
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
    return {"kept": round(float(sum(shares) / len(shares)), 4) if shares else None, "bounded": bounded, "cut": len(cut)}


# -- the report --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Figure4Row:
    """One plan: its runs by the names of the methods, and what was found about controllability."""

    instance: str
    origin: Origin
    parameters: int
    runs: Mapping[str, Run]
    controllability: Assessment | None

    @property
    def name(self) -> str:
        return self.instance

    @property
    def group(self) -> str:
        return self.origin.value

    def seconds(self, method: str) -> float | None:
        """The processor time of a run that came to an end by itself."""
        run = self.runs.get(method)
        return run.cpu_s if run is not None and run.complete else None

    def time(self, method: str) -> str:
        """The same as text, or how the run ended."""
        run = self.runs.get(method)
        return NOTHING if run is None else number(run.cpu_s) if run.complete else run.status.value

    @property
    def unbounded(self) -> str:
        """Directions in which the widened box has no end, and those that only a number in the domain ends."""
        run = self.runs.get("widen")
        if run is None or run.box is None:
            return NOTHING
        return f"{len(run.unbounded)} + {len(run.capped)} of {2 * len(run.box)}"

    @property
    def found(self) -> Assessment:
        return self.controllability or Assessment(NOTHING)


ASSESSED: Columns[Figure4Row] = {
    "plan": lambda row: row.instance,
    "parameters": lambda row: row.parameters,
    "dynamically": lambda row: row.found.dynamic or row.found.status,
    "strongly": lambda row: row.found.strong,
    "width kept": lambda row: None if row.found.kept is None else f"{100 * row.found.kept:.1f} %",
    "faces bounded": lambda row: NOTHING if row.found.bounded is None else row.found.bounded,
}


class Figure4Report(MethodsReport):
    """Plans of the delivery domain: those of the data set, and our own (`robust bench figure4`). The paper's IRR solved
    15 of its instances within an hour, and CCMMZ 3. A run is a whole process. The optimal box and the regions stand for
    what CCMMZ computes.
    """

    TITLE = "Figure 4: scaling in the delivery domain"
    SETTINGS: ClassVar[Mapping[str, str]] = {"limit_s": "limit", "baseline_limit_s": "baseline_limit", "jobs": "jobs"}
    ROW = Figure4Row
    LAYOUT = (5.2, 5, "below")
    CONTENDERS = CONTENDERS

    @classmethod
    def read_options(cls, answer: Mapping[str, Any]) -> dict[str, Any]:
        methods = {name for one in answer["solved"] for name in one["methods"]}
        return {**super().read_options(answer), "contenders": tuple(one for one in CONTENDERS if one.name in methods)}

    def printed(self, row: Figure4Row) -> dict[str, Any]:
        names = (*COST, "box", "unbounded", "capped", "polyhedra")
        runs = {name: run.printed(*names) for name, run in row.runs.items()}
        return {**super().printed(replace(row, runs={})), "runs": runs}

    def sound(self) -> bool:
        """Whether nothing failed, and IRR and exact widening solved every plan within their limit."""
        ours = [one.name for one in self.contenders if one in OURS]
        return not self.wrong and all(row.seconds(name) is not None for row in self.rows for name in ours)

    def remarks(self) -> Sequence[str]:
        ours, others = (limits_text(limit, {}) for limit in (self.options.limit, self.options.baseline_limit))
        return [
            f"processor time of whole processes; IRR and widening with {ours}, the others with {others}",
            *self.wrong,
        ]

    def findings(self) -> Mapping[str, Any]:
        solved = []
        for group in self.groups:
            methods = {one.name: len(one.times) for one in self.curves(group)}
            solved.append({"origin": group, "plans": len(self.of(group=group)), "methods": methods})
        return {"solved": solved}

    def page_contents(self) -> list[Table]:
        """How many plans each method solves."""
        limits = [limit for limit in (self.options.limit, self.options.baseline_limit) if limit is not None]
        marks = [mark for mark in MARKS if not limits or mark <= max(limits)]
        return [self.solved(group, marks) for group in self.groups]

    def contents(self) -> list[Table]:
        """Times of every plan, how many each method solves, and controllability."""
        times: Columns[Figure4Row] = {
            "plan": lambda row: row.instance,
            "parameters": lambda row: row.parameters,
            **family("{}", [one.name for one in self.contenders], lambda name, row: row.time(name)),
            "unbounded + capped": lambda row: row.unbounded,
        }
        rows = [row for group in self.groups for row in (*self.of(group=group), None)]
        assessed = [row for row in self.rows if row.controllability is not None]
        return [
            Table.of("Seconds by plan", times, rows),
            *self.page_contents(),
            Table.of("Controllability of the widened box", ASSESSED, assessed, whole=False),
        ]

    def conclusions(self) -> Sequence[str]:
        """About the boxes of exact widening: where they end, and whether they are controllable."""
        boxes = [run for row in self.rows if (run := row.runs.get("widen")) is not None and run.box is not None]
        ends = sum(2 * len(run.box or ()) for run in boxes)
        infinite, capped = sum(len(run.unbounded) for run in boxes), sum(len(run.capped) for run in boxes)
        unbounded = (
            f"Of the {ends} ends of the {len(boxes)} boxes of exact widening, {infinite} are infinite, and {capped} "
            "are durations that nothing bounds above but the number in the duration constraint of their action. The "
            "JSON names each such direction."
        )
        found = [row.controllability for row in self.rows if row.controllability is not None]
        if not found:
            return [unbounded, "Controllability was not asked for."]
        dynamic = _counts(one.dynamic or one.status for one in found)
        strong = _counts(one.strong or one.status for one in found)
        kept = [one.kept for one in found if one.kept is not None]
        text = f"Of {len(found)} boxes of exact widening: dynamically controllable: {dynamic}; strongly: {strong}."
        if kept:
            text += f" Made dynamically controllable, they keep {100 * mean(kept):.1f} % of their widths on average."
        return [unbounded, text]

    def panels(self) -> list[Panel]:
        """One panel for the recorded plans and one for ours: the time of every run over the number of parameters."""
        rows = {group: sorted(self.of(group=group), key=lambda row: row.parameters) for group in self.groups}
        return [self._panel(group, found) for group, found in rows.items()]

    def _panel(self, group: str, rows: Sequence[Figure4Row]) -> Panel:
        dots = []
        for one in self.contenders:
            colour, _, marker = STYLES.get(one.name, OTHER)
            runs = [(row.parameters, row.runs[one.name]) for row in rows if one.name in row.runs]
            done = [(size, run.cpu_s) for size, run in runs if run.complete]
            late = [(size, run.seconds) for size, run in runs if run.status is Ending.TIMEOUT]
            label = f"{one.label}: {len(done)} of {len(rows)}" if len(self.groups) == 1 else one.label
            dots.append(Series(done, label, colour, marker=marker, size=4, look={"alpha": 0.85}))
            dots.append(Series(late, None, colour, marker="x", size=6, look={"clip_on": False}))
        return Panel(f"{group} plans: {len(rows)}", dots, "parameters (×: out of time)", "time", seconds="y")


def _counts(values: Iterator[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in Counter(values).most_common())


SIZES = range(1, 34)
"""Numbers of parameters of our own plans."""


def _prepare(options: Figure4Options, _: object) -> tuple[DeliveryInstance, ...]:
    sizes = SIZES if options.sizes is None else options.sizes
    recorded = () if options.suite is None else recorded_instances(options.suite)
    instances = (*recorded, *(own_instance(size, options.seed) for size in sizes))
    if not instances:
        raise InputError("found no plan, expected a data set or sizes")
    return instances


def _tasks(options: Figure4Options, instances: tuple[DeliveryInstance, ...]) -> list[Task]:
    contenders = CONTENDERS if options.contenders is None else options.contenders
    limits = dict.fromkeys(BASELINE, options.baseline_limit)
    return [
        Task(f"{instance.name}, {one.name}", (instance, one, limits.get(one, options.limit)))
        for instance in instances
        for one in (*contenders, CONTROLLABILITY)
    ]


def _rows(_: Figure4Options, instances: tuple[DeliveryInstance, ...], results: Results) -> list[Figure4Row]:
    rows, named = [], {one.name: one for one in instances}
    for name, found in by_instance(results).items():
        one = named[name]
        runs = {method: each.run for method, each in found.items() if each.run is not None}
        assessed = found.get(CONTROLLABILITY.name, Found()).assessment
        rows.append(Figure4Row(name, one.origin, one.parameters, runs, assessed))
    return rows


FIGURE4 = Experiment(
    "figure4", Figure4Options, _tasks, do, Figure4Report, str, prepare=_prepare, collect=_rows, lenient=True
)
