"""Several plans of one problem, the one that bears most deviation first.

All plans must end by the same time. A plan is the better the more all its durations may be longer or shorter at once
and it still does (λ*, :func:`robust.irr.proposals.tolerance`); where durations are random, the more probable it is that
it does. Of plans that are equal in this, the one that ends first is the better.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import PurePath

from robust.errors import InputError, Location, RobustError
from robust.execute.convert import Settings, convert
from robust.execute.parametrization import earliest_end, latest_end, with_deadline
from robust.irr.proposals import tolerance
from robust.irr.stops import Tolerance
from robust.numbers import Number
from robust.plan import load, model, parameters, stn, timed
from robust.plan.pddl import forms, syntax
from robust.presented import VerdictEnum
from robust.probability.measure import Bounds
from robust.searching import Searching, Status, Stoppable
from robust.smt.limits import Deadline


class Fitness(VerdictEnum):
    """What a plan is good for: `valid` and in time; `late` whatever happens; `wrong`, for a reason; not `asked` yet."""

    VALID = "valid"
    LATE = "late"
    WRONG = "wrong"
    UNASKED = "unasked"


@dataclass(frozen=True, slots=True)
class RankedPlan:
    """A plan and what it bears.

    Attributes:
        name: that of its file, with its number in a log that holds several.
        fitness: valid: proved, and can be in time; late: ends too late as planned; wrong: for the reason given;
            unasked: time was over.
        end: when it ends as planned; None if it cannot be read.
        tolerance: λ*: how much all durations may be longer or shorter at once, as a share of their nominal values; None
            if that is not one number.
        success: the probability that it is in time; None without distributions.
        reason: why it is wrong, or has no tolerance.
    """

    name: str
    fitness: Fitness
    end: Fraction | None = None
    tolerance: Tolerance | None = None
    success: Bounds | None = None
    reason: str | None = None

    @property
    def merit(self) -> tuple[bool, Fraction, Fraction, Fraction]:
        """The greater the better."""
        success = Fraction(-1) if self.success is None else self.success.lower + self.success.upper
        ratio = Fraction(-1) if self.tolerance is None else self.tolerance.ratio
        return self.fitness is Fitness.VALID, success, ratio, -(self.end or Fraction(0))


@dataclass(frozen=True)
class Ranking(Stoppable, ask="plans"):
    """Plans, the best first; `latest` is the time by which all must end, in their unit."""

    status: Status
    plans: tuple[RankedPlan, ...]
    latest: Fraction
    epsilon: Fraction
    seconds: float
    reason: str | None = None

    @property
    def deciding(self) -> tuple[str, ...]:
        """For each plan but the last one what makes it better than the next, in a sentence."""
        return tuple(_difference(better, worse) for better, worse in zip(self.plans, self.plans[1:], strict=False))


def _difference(better: RankedPlan, worse: RankedPlan) -> str:
    first, second = f"{better.name} before {worse.name}", worse.fitness
    if second is not Fitness.VALID:
        return f"{first}: {worse.name} is {second.value}" + (f": {worse.reason}" if worse.reason else "")
    if better.success is not None and worse.success is not None and better.merit[1] != worse.merit[1]:
        return f"{first}: more likely in time"
    if better.merit[2] != worse.merit[2]:
        ends = f"what ends {worse.name}: {worse.tolerance.what}" if worse.tolerance else f"{worse.name}: {worse.reason}"
        return f"{first}: bears more; {ends}"
    return f"{first}: ends earlier" if better.end != worse.end else f"{first}: as given, they are equal"


class RankSearch(Searching[Ranking]):
    """Asks about plans one by one.

    Args:
        domain: of all plans.
        problem: of all plans.
        plans: networks or steps of planners: paths, texts or what reading one gives; a log may hold several.
        specs: what becomes a parameter.
        latest: by when all plans must end: a time, or `+10%` for 10 per cent after the last one ends as planned.
        settings: how steps become networks.
        success: the probability that a plan succeeds, where durations are random.
        deadline: when to stop asking.
        on_plan: called with the name of each plan that is asked about.

    Raises:
        InputError: if no plan can be read.
    """

    def __init__(
        self,
        domain: syntax.Domain,
        problem: syntax.Problem,
        plans: Sequence[load.File | timed.TimedPlan | stn.STNPlan],
        *,
        specs: Sequence[parameters.ParameterSpec],
        latest: Number,
        settings: Settings,
        success: Callable[[model.ParametrizedPlan, Deadline], Bounds] | None,
        deadline: Deadline,
        on_plan: Callable[[str], None],
    ) -> None:
        super().__init__()
        self._domain, self._problem = domain, problem
        self._specs, self._settings = tuple(specs), settings
        self._success, self._deadline, self._on_plan = success, deadline, on_plan
        self._plans: dict[str, timed.TimedPlan | stn.STNPlan] = {}
        self._ranked: dict[str, RankedPlan] = {}
        for name, plan in named(plans):
            if isinstance(plan, RobustError):
                self._ranked[name] = RankedPlan(name, Fitness.WRONG, reason=str(plan))
            else:
                self._plans[name] = plan
                self._ranked[name] = RankedPlan(name, Fitness.UNASKED, self._end(plan))
        ends = [ranked.end for ranked in self._ranked.values() if ranked.end is not None]
        if not ends:
            raise InputError(f"found no plan that can be read: {next(iter(self._ranked.values())).reason}")
        self._latest = latest_end(latest, max(ends), Location("--deadline"))

    def _end(self, plan: timed.TimedPlan | stn.STNPlan) -> Fraction:
        if isinstance(plan, stn.STNPlan):
            return earliest_end(plan)
        return max(step.time + (step.duration or 0) for step in plan.steps)

    def _search(self) -> None:
        for name, plan in self._plans.items():
            self._on_plan(name)
            self._deadline.enforce()
            self._ranked[name] = self._asked(self._ranked[name], plan)

    def _asked(self, ranked: RankedPlan, plan: timed.TimedPlan | stn.STNPlan) -> RankedPlan:
        """The plan with what it bears; what is wrong with one is its answer, and the others go on."""
        if ranked.end is not None and ranked.end > self._latest:
            return replace(ranked, fitness=Fitness.LATE)
        try:
            network = self._network(plan)
            found = tolerance(network, self._settings.epsilon, self._deadline, self._settings.solver)
            success = None if self._success is None else self._success(network, self._deadline)
        except RobustError as error:
            return replace(ranked, fitness=Fitness.WRONG, reason=str(error))
        reason = None if found is not None else "no single number: durations are no parameters, or numbers decide"
        return replace(ranked, fitness=Fitness.VALID, tolerance=found, success=success, reason=reason)

    def _network(self, plan: timed.TimedPlan | stn.STNPlan) -> model.ParametrizedPlan:
        if isinstance(plan, timed.TimedPlan):
            settings = replace(self._settings, specs=self._specs, deadline=self._latest)
            return convert(self._domain, self._problem, plan, settings).plan
        limited = with_deadline(plan, self._latest, Location("--deadline"))
        return load.assemble(self._domain, self._problem, limited, self._specs)

    def _result(self, status: Status, reason: str | None = None) -> Ranking:
        ordered = sorted(self._ranked.values(), key=lambda ranked: ranked.merit, reverse=True)
        return Ranking(status, tuple(ordered), self._latest, self._settings.epsilon, self._seconds(), reason)


def named(
    sources: Sequence[load.File | timed.TimedPlan | stn.STNPlan],
) -> Iterator[tuple[str, timed.TimedPlan | stn.STNPlan | RobustError]]:
    """The plans of all sources, by names of files, by paths where names are equal, and texts by their places."""
    files = [
        source if isinstance(source, str | os.PathLike) and not forms.is_text(source) else f"plan {place}"
        for place, source in enumerate(sources, start=1)
    ]
    bases = [PurePath(file).name for file in files]
    for source, file, base in zip(sources, files, bases, strict=True):
        for number, plan in plans_of(source):
            yield f"{base if bases.count(base) == 1 else file}{number}", plan


def plans_of(
    source: load.File | timed.TimedPlan | stn.STNPlan,
) -> Iterator[tuple[str, timed.TimedPlan | stn.STNPlan | RobustError]]:
    """The plans of a source, in its order; of several ones each with its number."""
    try:
        if isinstance(source, timed.TimedPlan | stn.STNPlan):
            yield "", source
            return
        text, name = forms.plan_text(source)
        if stn.is_network(text, name):
            yield "", stn.parse_stn(text, name)
            return
        plans = [plan for plan in timed.plans_in(text, name) if isinstance(plan, timed.TimedPlan)][::-1]
        if not plans:
            raise InputError("found no plan, expected at least one", Location(name))
    except RobustError as error:
        yield "", error
        return
    for number, plan in enumerate(plans, start=1):
        yield ("" if len(plans) == 1 else f" #{number}"), plan
