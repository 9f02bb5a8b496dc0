"""`robust bench conversions`: time-triggered plans converted to the least constrained network, and what is left in it.

Plans are drawn at random, generated for the delivery domain, or made by a planner for problems of that domain
(:mod:`benchmarks.generators.plans`). Each is converted in mode `causal`. The network must be proved valid and allow
the plan's own schedule, which the simulator executes; then each bound is removed in turn, and the plan proved or
refuted without it. A bound is removable if the plan without it, and with all others, is still proved valid for every
schedule. Either the other bounds imply it, so that no schedule is gained by removing it, or schedules are gained, and
the network could have been less constrained.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import partial
from statistics import median
from typing import ClassVar

from robust.encode.interface import EPSILON
from robust.errors import InputError, RobustError
from robust.execute.causal import check_plan
from robust.execute.convert import Conversion, Mode, Settings, convert
from robust.execute.distances import DistanceEdge, EdgeNetwork
from robust.execute.planners import create_planner
from robust.irr.check import Answer, CheckResult
from robust.plan.model import ZERO, Bound, ParametrizedPlan, TemporalConstraint
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import mutex_pairs, simulate
from robust.plan.timed import TimedPlan, parse_timed_plan
from robust.smt.limits import Deadline

from ..catalogue import ConversionOptions
from ..engine.experiment import Experiment, Report, Task
from ..engine.show import Columns, Table, family, number
from ..generators.delivery import PlanTexts
from ..generators.plans import delivery_order, delivery_plan, drawn_plan

PLANNING_S = 20.0
"""What a planner has for a problem."""
PROBLEMS = 10
"""Problems that are tried until the planner finds a plan."""


# -- judgements --------------------------------------------------------------------------------------------------------


class Kind(Enum):
    """What a constraint is for."""

    DURATION = "duration"
    SEPARATION = "separation of mutex time points"
    LITERAL = "before or after a timed literal"
    PROTECTION = "over-all condition"
    NUMBERS = "bound that numbers need"


class Removal(Enum):
    """What becomes of the plan without a constraint."""

    NEEDED = "needed"
    IMPLIED = "implied by others"
    NEEDLESS = "not needed"
    UNKNOWN = "unknown"

    @property
    def removable(self) -> bool:
        return self in {Removal.IMPLIED, Removal.NEEDLESS}


@dataclass(frozen=True, slots=True)
class Judgement:
    """One bound, and whether the plan needs it."""

    edge: DistanceEdge
    kind: Kind
    removal: Removal


def judge_constraints(conversion: Conversion, epsilon: Fraction, solver: str, deadline: Deadline) -> list[Judgement]:
    """Remove each bound of a converted plan in turn; the plan must have no parameters.

    Raises:
        KeyboardInterrupt: if interrupted.
    """
    edges = list(edges_of(conversion.plan))
    check = partial(check_plan, epsilon=epsilon, solver=solver, deadline=deadline)
    return [Judgement(one, _kind(conversion, one), _removal(conversion.plan, edges, one, check)) for one in edges]


def edges_of(plan: ParametrizedPlan) -> Iterator[DistanceEdge]:
    """Both sides of every constraint as lower bounds.

    Raises:
        ValueError: if a bound has parameters.
    """
    for one in plan.constraints:
        if one.lower is not None:
            yield DistanceEdge(one.source, one.target, _value(one.lower))
        if one.upper is not None:
            yield DistanceEdge(one.target, one.source, -_value(one.upper))


def _value(bound: Bound) -> Fraction:
    if any(bound.terms):
        raise ValueError(f"{bound} is not a number; constraints are judged without parameters")
    return bound.constant_term


def _removal(
    plan: ParametrizedPlan,
    edges: Sequence[DistanceEdge],
    one: DistanceEdge,
    check: Callable[[ParametrizedPlan], CheckResult],
) -> Removal:
    others = [other for other in edges if other is not one]
    points = [point for point in plan.time_points if point.time is None]
    nonnegative = [DistanceEdge(ZERO, point, Fraction(0)) for point in points if point != ZERO]
    if EdgeNetwork(points, (*nonnegative, *others)).implies(one):
        return Removal.IMPLIED
    constraints = tuple(
        TemporalConstraint(other.source, other.target, Polynomial.constant(other.weight), None) for other in others
    )
    verdicts = {Answer.PROVED: Removal.NEEDLESS, Answer.REFUTED: Removal.NEEDED, Answer.UNKNOWN: Removal.UNKNOWN}
    return verdicts[check(replace(plan, constraints=constraints)).answer]


def _kind(conversion: Conversion, one: DistanceEdge) -> Kind:
    pair = {one.source, one.target}
    if one in {tightening.edge for tightening in conversion.tightened}:
        return Kind.NUMBERS
    if one.source.instance is not None and one.source.instance == one.target.instance:
        return Kind.DURATION
    if ZERO in pair:
        return Kind.LITERAL
    if any(pair == set(mutex) for mutex in mutex_pairs(conversion.plan)):
        return Kind.SEPARATION
    return Kind.PROTECTION


# -- one plan ----------------------------------------------------------------------------------------------------------


class Source(Enum):
    """Where a plan comes from."""

    DRAWN = "drawn"
    DELIVERY = "delivery"
    PLANNED = "planned"


@dataclass(frozen=True, slots=True)
class Count:
    """So many bounds of one kind, and what becomes of the plan without one."""

    kind: Kind
    removal: Removal
    bounds: int


@dataclass(frozen=True)
class ConversionRow:
    """One plan and what was found.

    `allowed` says whether the plan's own schedule is one of the network's and breaks nothing.
    """

    source: Source
    seed: int
    plan: str
    steps: int
    proved: bool
    allowed: bool
    tightened: int
    bounds: tuple[Count, ...]
    removable: tuple[str, ...]
    convert_s: float
    judge_s: float

    def count(self, kind: Kind | None, removal: Removal) -> int:
        """Of one kind, or of all."""
        return sum(one.bounds for one in self.bounds if kind in {None, one.kind} and one.removal is removal)

    @property
    def holds(self) -> bool:
        """Whether the network is proved, allows the plan, and holds nothing that is not known to be needed."""
        return self.proved and self.allowed and not self.removable and not self.count(None, Removal.UNKNOWN)


def convert_and_judge(
    source: Source, seed: int, limit: float | None = None, planner: str | None = None
) -> ConversionRow:
    """Convert one plan, which that planner makes if it is a planned one, and judge its bounds, in `limit` seconds each.

    Raises:
        RobustError: if there is no plan, or it cannot be converted.
    """
    makers = {Source.DRAWN: drawn_plan, Source.DELIVERY: delivery_plan}
    texts = makers.get(source, partial(_planned, planner or ""))(seed)
    started = time.perf_counter()
    domain = parse_domain(texts.domain)
    problem = parse_problem(texts.problem, domain)
    timed = parse_timed_plan(texts.plan)
    conversion = convert(domain, problem, timed, Settings(mode=Mode.CAUSAL, timeout=limit))
    converted = time.perf_counter()
    judgements = judge_constraints(conversion, EPSILON, "z3", Deadline.after(limit))
    counts = Counter((one.kind, one.removal) for one in judgements)
    return ConversionRow(
        source=source,
        seed=seed,
        plan=texts.plan,
        steps=len(timed.steps),
        proved=conversion.check.answer is Answer.PROVED,
        allowed=is_allowed(conversion, timed),
        tightened=len(conversion.tightened),
        bounds=tuple(Count(*kinds, bounds) for kinds, bounds in counts.items()),
        removable=tuple(
            f"{one.edge} ({one.kind.value}, {one.removal.value})" for one in judgements if one.removal.removable
        ),
        convert_s=round(converted - started, 4),
        judge_s=round(time.perf_counter() - converted, 4),
    )


def is_allowed(conversion: Conversion, timed: TimedPlan) -> bool:
    """Whether the times of the steps as they were given, and no others, satisfy the network and break nothing."""
    times = dict(conversion.schedule)
    for step, instance in zip(timed.steps, conversion.plan.instances, strict=True):
        if times[instance.start] != step.time or times[instance.end] != step.time + (step.duration or 0):
            return False
    return simulate(conversion.plan, conversion.plan.nominal, times, epsilon=EPSILON).valid


def _planned(name: str, seed: int) -> PlanTexts:
    """A planner's plan for the first of some problems for which it finds one."""
    planner = create_planner(name)
    reason = "no problem was tried"
    for place in range(seed * PROBLEMS, (seed + 1) * PROBLEMS):
        texts = delivery_order(place)
        domain = parse_domain(texts[0])
        answer = planner.solve(domain, parse_problem(texts[1], domain), Deadline.after(PLANNING_S))
        if answer.plan is not None:
            return PlanTexts(*texts, "".join(f"{step}\n" for step in answer.plan.steps))
        reason = answer.message
    raise RobustError(f"planner {name!r} found no plan for {PROBLEMS} problems, expected one; the last one: {reason}")


# -- the report --------------------------------------------------------------------------------------------------------


FACTS: Mapping[str, Callable[[Sequence[ConversionRow]], object]] = {
    "plans": len,
    "proved valid": lambda rows: sum(row.proved for row in rows),
    "allow the plan itself": lambda rows: sum(row.allowed for row in rows),
    "with a removable bound": lambda rows: sum(bool(row.removable) for row in rows),
    "with bounds that numbers need": lambda rows: sum(row.tightened > 0 for row in rows),
    "steps, median": lambda rows: number(median(row.steps for row in rows), 0),
    "seconds to convert, median": lambda rows: median(row.convert_s for row in rows),
    "seconds to convert, longest": lambda rows: max(row.convert_s for row in rows),
}
"""What is said of the plans of a source."""


class ConversionReport(Report[ConversionRow]):
    """Time-triggered plans, each converted to the least constrained network (`robust bench conversions`); then each
    bound was removed in turn, and the plan proved or refuted without it."""

    TITLE = "Conversions"
    SETTINGS: ClassVar[Mapping[str, str]] = {"limit_s": "limit"}

    def sound(self) -> bool:
        """Whether each network is proved, allows the plan, and needs all of its bounds."""
        return all(row.holds for row in self.rows)

    def remarks(self) -> Sequence[str]:
        notes = [f"{row.source.value} {row.seed}: {text}" for row in self.rows for text in row.removable][:5]
        if any(row.source is Source.PLANNED for row in self.rows):
            notes.append(f"planned by {self.options.planner}, which may find other plans next time")
        return notes

    def contents(self) -> list[Table]:
        """Plans by source, and bounds by what they are for."""
        sources = {row.source: self.of(source=row.source) for row in self.rows}
        named = {source.value: rows for source, rows in sources.items()}
        columns: Columns[str] = {"": str, **family("{}", named, lambda name, fact: FACTS[fact](named[name]))}
        plans = Table.of("Converted plans", columns, FACTS, whole=False)
        if self.failures:
            failed = ("failed", f"{len(self.failures)} in all", *[""] * len(sources))
            headings = plans.headings if sources else ("", "")
            plans = replace(plans, headings=headings, rows=[*plans.rows, failed[: len(headings)]])
        bounds: Columns[Kind | None] = {
            "what it is for": lambda kind: "all" if kind is None else kind.value,
            "bounds": lambda kind: sum(self._count(kind, removal) for removal in Removal),
            **family("{0.value}", Removal, lambda removal, kind: self._count(kind, removal)),
        }
        kinds = [kind for kind in Kind if any(self._count(kind, removal) for removal in Removal)]
        by_kind = Table.of("Bounds, removed one at a time", bounds, kinds, whole=False)
        total = tuple(str(value(None)) for value in bounds.values())
        return [plans, replace(by_kind, rows=[*by_kind.rows, None, total])]

    def _count(self, kind: Kind | None, removal: Removal) -> int:
        return sum(row.count(kind, removal) for row in self.rows)

    def conclusions(self) -> Sequence[str]:
        return [f"{one.task}: {one.reason}" for one in self.failures]


def _tasks(options: ConversionOptions, _: object) -> list[Task]:
    numbers = (options.drawn, options.delivery, options.planned)
    if min(numbers) < 0 or sum(numbers) == 0:
        found = f"{options.drawn}, {options.delivery} and {options.planned}"
        raise InputError(f"found {found} as numbers of plans, expected at least one plan")
    if options.planned:
        create_planner(options.planner)  # before anything runs for long
    planners = (None, None, options.planner)
    return [
        Task(f"{source.value} {seed}", (source, seed, options.limit, planner))
        for source, count, planner in zip(Source, numbers, planners, strict=True)
        for seed in range(options.seed, options.seed + count)
    ]


def _describe(row: ConversionRow) -> str:
    verdict = "proved" if row.proved and row.allowed else "NOT proved or excludes its plan"
    bounds = sum(one.bounds for one in row.bounds)
    return f"{row.steps} steps, {verdict}, {len(row.removable)} of {bounds} bounds removable"


CONVERSIONS = Experiment(
    "conversions", ConversionOptions, _tasks, convert_and_judge, ConversionReport, _describe, lenient=True
)
