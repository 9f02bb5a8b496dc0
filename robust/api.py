"""The verbs of the package as functions: check, envelope, region and others; and as searches that can be given up.

What a verb takes by name are the fields of its class in :mod:`robust.options`, of which its command is made as well:
`check(plan, timeout=5)` reads the plan, makes `CheckOptions(timeout=5)`, and calls the function of that name below,
whose search is :func:`searching_check`. What is not asked for is not imported.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from robust.errors import InputError, did_you_mean
from robust.numbers import Number, shorten
from robust.options import declare, verbs
from robust.options.batch import BATCHES, AnyBatchOptions, BatchOptions
from robust.plan.load import File, require_nominal_values
from robust.plan.model import ParametrizedPlan
from robust.plan.parameters import parameters_by_action, specifications
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.stn import STNPlan
from robust.plan.timed import TimedPlan
from robust.qe.box import Box, Interval
from robust.reading import WHEN_READ, Plan, domain_and_problem, domain_of, plan_of
from robust.smt.limits import Deadline, one_question

if TYPE_CHECKING:
    from robust.execute.learned import Learned, Randomness
    from robust.irr.check import CheckResult
    from robust.irr.compare import Comparing, Comparison
    from robust.irr.exact import BoxMethod, EnvelopeQuestion
    from robust.irr.questions import CheckQuestion, Manner
    from robust.irr.repair import Repair, RepairSearch
    from robust.irr.search import EnvelopeResult
    from robust.irr.slices import EnvelopeRegion
    from robust.probability.distributions import Distribution
    from robust.probability.measure import Bounds
    from robust.probability.risk import Risk, RiskResult
    from robust.qe.compute import RegionResult
    from robust.sweeps.batch import Batch
    from robust.sweeps.rank import Ranking, RankSearch

Given = ParamSpec("Given")
Item = TypeVar("Item")


def _read(plan: Plan, options: declare.Options) -> ParametrizedPlan:
    return plan_of(plan, getattr(options, "separation", "1/1000"))


verb = declare.Verb(
    _read,
    "what :func:`load_plan` or :func:`convert` returns, or a domain, a problem and a plan: three paths or texts",
    dict.fromkeys(
        (*WHEN_READ, "parameter"),
        "it is chosen when the plan is read: load_plan(domain, problem, plan, parameters=...)",
    ),
)


def _several(given: File | Iterable[Item], name: str, expected: str) -> tuple[File | Item, ...]:
    """Inputs, of which a single one may be given by itself; at least one."""
    items = (given,) if isinstance(given, str | os.PathLike) else given
    if not isinstance(items, Iterable) or isinstance(items, bytes | Mapping) or not (several := tuple(items)):
        raise InputError(f"found {shorten(repr(given))}, expected {expected}", declare.place_of(name))
    return several


def _manner(options: verbs.CheckOptions | verbs.EnvelopeOptions) -> Manner:
    """How options ask about a plan."""
    from robust.irr.questions import Manner
    from robust.smt.session import Exporter

    return Manner(
        encoding=options.encoding,
        solver=options.solver,
        epsilon=options.separation,
        deadline=Deadline.after(options.limit),
        exporter=None if options.smt2 is None else Exporter(options.smt2),
    )


def _intervals(
    plan: ParametrizedPlan, given: declare.Settings | Box | EnvelopeResult, option: str
) -> dict[str, Interval]:
    """Intervals that an option gives; of several for a parameter, that for the fewest parameters counts."""
    groups = parameters_by_action(plan)
    intervals: dict[str, Interval] = {}
    said = declare.settings(given, [parameter.name for parameter in plan.parameters], option, groups)
    for name in sorted(said, key=lambda name: -len(groups.get(name, ()))):
        intervals |= dict.fromkeys(groups.get(name, (name,)), said[name])
    return intervals


# -- check -------------------------------------------------------------------------------------------------------------


def searching_check(plan: ParametrizedPlan, options: verbs.CheckOptions) -> CheckQuestion:
    """The search behind :func:`check`."""
    from robust.irr.questions import CheckQuestion

    require_nominal_values(plan.parameters)
    box = Box.nominal(plan.parameters).changed(_intervals(plan, options.at, "at"))
    if options.tree is None:
        return CheckQuestion(plan, _manner(options), box, every=options.every, on_obligation=options.on_obligation)
    from robust.execute.trees import TreeQuestion, read_tree

    return TreeQuestion(
        plan,
        _manner(options),
        box,
        tree=read_tree(options.tree, plan),
        lag=None if options.lag is None else Fraction(options.lag),
        within=options.within is not None,
        every=options.every,
        on_obligation=options.on_obligation,
    )


@verb(verbs.CheckOptions)
def check(plan: ParametrizedPlan, options: verbs.CheckOptions) -> CheckResult:
    """Decide whether the plan is valid for every schedule that its network allows [docs/semantics.md].

    With `tree`, for every execution that a behavior tree of PlanSys2 allows instead: see :mod:`robust.execute.trees`.

    Returns:
        A verdict with a confirmed counterexample where it is REFUTED. Ctrl-C returns what is known by then.

    Raises:
        InputError: wrong options, or a network without any schedule.
        UnsupportedError: an expression that is not linear.
    """
    return searching_check(plan, options).run()


# -- envelope ----------------------------------------------------------------------------------------------------------


def searching_envelope(plan: ParametrizedPlan, options: verbs.EnvelopeOptions) -> EnvelopeQuestion:
    """The search behind :func:`envelope`."""
    from robust.irr.exact import BoxMethod, EnvelopeQuestion
    from robust.irr.templates import template_of

    if options.from_nominal:
        require_nominal_values(plan.parameters)
    if options.method == "risk":
        from robust.probability.greatest import RandomBoxMethod

        method: BoxMethod = RandomBoxMethod(
            "risk", distributions=box_distributions(plan, options), within=Fraction(options.within)
        )
    else:
        order = tuple(options.order or ())
        method = BoxMethod(options.method, options.precision, options.doubling, order, options.contain_nominal)
    names = [parameter.name for parameter in plan.parameters]
    shape = None if options.shape == "box" else (options.shape, template_of(options.shape, names))
    return EnvelopeQuestion(plan, _manner(options), method, shape=shape, on_step=options.on_step)


def box_distributions(plan: ParametrizedPlan, options: verbs.EnvelopeOptions) -> Mapping[str, Distribution]:
    """The distributions for the most probable box; InputError if some parameter has none, or depends on another."""
    random = randomness_of(plan, options.distribution, world=options.world)
    if random.factors or random.joints:
        place = declare.place_of("world")
        raise InputError(
            "found parameters that depend on each other, expected independent ones for --method risk", place
        )
    return random.distributions


@verb(verbs.EnvelopeOptions)
def envelope(plan: ParametrizedPlan, options: verbs.EnvelopeOptions) -> EnvelopeResult:
    """A box of parameter values under which the plan stays valid [IRR, Definition 3].

    Returns:
        The best box found, inside the envelope. It holds no values if the nominal point itself is outside (INVALID), or
        if time ran out before that was known; `verified` tells. Ctrl-C returns the best box so far (INTERRUPTED).

    Raises:
        InputError: wrong options, or no schedule at the nominal point.
        UnsupportedError: an expression that is not linear.
    """
    return searching_envelope(plan, options).run()


# -- region and compare ------------------------------------------------------------------------------------------------


def searching_region(plan: ParametrizedPlan, options: verbs.RegionOptions) -> EnvelopeRegion:
    """The search behind :func:`region`."""
    from robust.irr.proposals import known_box
    from robust.irr.slices import EnvelopeRegion
    from robust.qe.compute import RegionSearch

    search = RegionSearch(
        plan,
        backend=options.backend,
        splitting=options.splitting,
        learning=options.learning,
        epsilon=options.separation,
        encoding=options.encoding,
        solver=options.solver,
        timeout=options.limit,
        on_piece=options.on_piece,
        on_cell=options.on_cell,
        find_box=partial(known_box, plan, options.separation, options.solver),
    )
    return EnvelopeRegion(search)


@verb(verbs.RegionOptions)
def region(plan: ParametrizedPlan, options: verbs.RegionOptions) -> RegionResult:
    """All parameter values under which the plan is valid, exactly: its robustness envelope [IRR, Definition 2].

    Returns:
        The envelope; or, out of time or after Ctrl-C, an outer bound of it, an inner one, and how much lies between.

    Raises:
        InputError: wrong options.
        UnsupportedError: an expression that is not linear, or one that the back end cannot handle.
        SolverError: a solver is not installed.
    """
    return searching_region(plan, options).run()


def searching_compare(plan: ParametrizedPlan, options: verbs.CompareOptions) -> Comparing:
    """The search behind :func:`compare`."""
    from robust.irr.compare import Comparing

    require_nominal_values(plan.parameters)
    return Comparing(
        plan,
        beta=Fraction(options.beta),
        doubling=options.doubling,
        epsilon=options.separation,
        encoding=options.encoding,
        solver=options.solver,
        timeout=options.limit,
        on_stage=options.on_stage,
    )


@verb(verbs.CompareOptions)
def compare(plan: ParametrizedPlan, options: verbs.CompareOptions) -> Comparison:
    """Compare the boxes of all methods with the exact envelope: shares, face gaps with witnesses, times.

    Returns:
        For each method its box, which share of the envelope's volume that is, and how far each face could move, in the
        parameter's unit; out of time or after Ctrl-C, what is known by then.

    Raises:
        InputError: wrong options, or a network without any schedule.
        UnsupportedError: an expression that is not linear.
    """
    return searching_compare(plan, options).run()


# -- risk --------------------------------------------------------------------------------------------------------------


def randomness_of(
    plan: ParametrizedPlan,
    given: Mapping[str, str | Distribution] | Sequence[str],
    factor: Sequence[str] = (),
    world: str | Path | None = None,
) -> Randomness:
    """The distributions of the parameters, and what they share; InputError if one has none."""
    from robust.execute import learned
    from robust.execute.rules import read_rules

    rules = None if world is None else read_rules(world)
    known = given if isinstance(given, Mapping) else declare.texts(given, declare.place_of("distribution"))
    factors = declare.texts(factor, declare.place_of("factor"))
    return learned.randomness_of(plan, known, factors, rules, declare.place_of)


def searching_risk(plan: ParametrizedPlan, options: verbs.RiskOptions) -> Risk:
    """The search behind :func:`risk`."""
    from robust.execute.controllability import served
    from robust.probability.risk import Risk

    random = randomness_of(plan, options.distributions, options.factor, options.world)
    return Risk(
        plan,
        random.distributions,
        factors=random.factors,
        joints=random.joints,
        within=Fraction(options.within),
        draws=options.draws,
        epsilon=options.separation,
        encoding=options.encoding,
        solver=options.solver,
        timeout=options.limit,
        on_bounds=options.on_bounds,
        on_stage=options.on_stage,
        serving=partial(served, plan),
    )


@verb.with_first(verbs.RiskOptions, "distributions")
def risk(plan: ParametrizedPlan, options: verbs.RiskOptions) -> RiskResult:
    """The probability that a plan succeeds when its parameters are random, as certified bounds.

    They are independent, but for factors and covariances that some of them share.

    Returns:
        Bounds that hold whatever ended the search; which obligations take the rest; and how probable boxes are.

    Raises:
        InputError: wrong options, or a parameter without a distribution.
        UnsupportedError: an expression that is not linear.
    """
    return searching_risk(plan, options).run()


# -- repair ------------------------------------------------------------------------------------------------------------


def searching_repair(plan: ParametrizedPlan, options: verbs.RepairOptions) -> RepairSearch:
    """The search behind :func:`repair`."""
    from robust.irr.quantities import Changeable
    from robust.irr.repair import RepairSearch

    kinds = {"bounds": (Changeable.BOUND,), "nominal": (Changeable.NOMINAL,), "both": tuple(Changeable)}
    required = _intervals(plan, options.require, "require")
    require_nominal_values(parameter for parameter in plan.parameters if parameter.name not in required)
    return RepairSearch(
        plan,
        require=required,
        kinds=kinds[options.change],
        count=options.count,
        reorder=options.reorder,
        epsilon=options.separation,
        solver=options.solver,
        deadline=Deadline.after(options.limit),
        on_repair=options.on_repair,
    )


@verb(verbs.RepairOptions)
def repair(plan: ParametrizedPlan, options: verbs.RepairOptions) -> Repair:
    """The least change after which the plan is valid for every schedule, and for all values that are required.

    Returns:
        The repaired plan, checked again, with its changes; out of time or after Ctrl-C the best one so far, and what
        none can cost less than. IMPOSSIBLE names what no allowed change reconciles.

    Raises:
        InputError: wrong options.
        UnsupportedError: an expression that is not linear.
        SolverError: the check does not confirm a repair.
    """
    return searching_repair(plan, options).run()


# -- several plans of one problem --------------------------------------------------------------------------------------


def searching_rank(
    domain: File | Domain,
    problem: File | Problem,
    plans: File | Sequence[File | TimedPlan | STNPlan],
    options: verbs.RankOptions,
) -> RankSearch:
    """The search behind :func:`rank`."""
    from robust.execute.convert import Settings
    from robust.execute.rules import read_rules
    from robust.sweeps.rank import RankSearch

    specs, _ = specifications(options.parameter, options.parameters)
    random = verbs.RiskOptions(
        distributions=options.distribution, world=options.world, epsilon=options.epsilon, solver=options.solver
    )
    if options.world is not None:
        read_rules(options.world)  # what is wrong with it is said once
    return RankSearch(
        *domain_and_problem(domain, problem),
        _several(plans, "plans", "plans: paths or texts"),
        specs=specs,
        latest=options.deadline,
        settings=Settings(epsilon=options.separation, solver=options.solver, timeout=options.limit),
        success=partial(_probability, random) if options.distribution or options.world is not None else None,
        deadline=Deadline.after(options.limit),
        on_plan=options.on_plan or (lambda _: None),
    )


def _probability(options: verbs.RiskOptions, plan: ParametrizedPlan, deadline: Deadline) -> Bounds:
    """How probably a plan succeeds, as far as that is known by then."""
    return searching_risk(plan, options.changed(timeout=deadline.remaining)).run().probability


def rank(
    domain: File | Domain,
    problem: File | Problem,
    plans: File | Sequence[File | TimedPlan | STNPlan],
    *,
    parameter: str | Sequence[str] = "duration:*",
    deadline: Number = "+10%",
    distribution: Sequence[str] = (),
    world: str | os.PathLike[str] | None = None,
    epsilon: Number = "1/1000",
    solver: str = "z3",
    timeout: Number | None = None,
    on_plan: Callable[[str], None] | None = None,
) -> Ranking:
    """Order several plans of one problem by how much they bear: the one first whose durations may deviate most.

    Args:
        domain: the PDDL domain: a path, a text, or what reading one gives.
        problem: the PDDL problem, likewise.
        plans: plans, likewise: networks or steps of planners; a log with several plans counts as several.
        parameter: what deviates, see :mod:`robust.plan.parameters`.
        deadline: by when every plan must end: a time, or `+P%` for P per cent after the last of them ends as planned.
        distribution: how durations are distributed, `NAME=KIND:...`; the more probable plan comes first then.
        world: the same in a TOML file.
        epsilon: the separation of mutex time points.
        solver: `z3` or `cvc5`.
        timeout: seconds after which no more plans are asked about.
        on_plan: called with the name of each plan that is asked about.

    Returns:
        The plans, the best first, with λ*, what ends it, and the probability of success where durations are random.

    Raises:
        InputError: wrong options, a wrong domain or problem, or no plan that can be read.
    """
    with one_question():
        options = verbs.RankOptions(
            parameter=(parameter,) if isinstance(parameter, str) else tuple(parameter),
            deadline=deadline,
            distribution=distribution,
            world=None if world is None else Path(world),
            epsilon=epsilon,
            solver=solver,
            timeout=timeout,
            on_plan=on_plan,
        )
        return searching_rank(domain, problem, plans, options).run()


# -- from logs ---------------------------------------------------------------------------------------------------------


def learn(
    logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    cover: Number = "0.95",
    confidence: Number = "0.95",
    pool: bool = False,
    domain: File | Domain | None = None,
) -> Learned:
    """Learn how long actions take from logs of their runs, without assuming a distribution.

    Args:
        logs: a file, or several in the order of time: CSV, messages of PlanSys2, executions, see [docs/formats.md].
        cover: the share of future runs that a limit covers.
        confidence: the confidence with which it does.
        pool: whether all ground instances of an action are taken together.
        domain: a PDDL domain (a path or a text) whose actions are the only ones that may be in the logs.

    Returns:
        For each action limits that hold as promised if runs are independent and alike, how many runs they need, whether
        later runs differ from earlier ones, and how many failed. `box` is for `at` and `require` of other functions.

    Raises:
        InputError: wrong options, or whatever is wrong in a log, with its line.
    """
    from robust.execute import learned

    options = verbs.LearnOptions(cover=cover, confidence=confidence, pool=pool)
    return learned.learn(
        _several(logs, "logs", "paths of logs"),
        cover=Fraction(options.cover),
        confidence=Fraction(options.confidence),
        pool=pool,
        known=() if domain is None else domain_of(domain).actions,
    )


# -- many plans --------------------------------------------------------------------------------------------------------


def run_batch(verb: str, suite: str | os.PathLike[str], options: BatchOptions) -> Batch:
    """Run a batch with options that have been checked; see :func:`batch`."""
    from robust.sweeps import batch

    return batch.run_batch(
        verb,
        options.asked,
        Path(suite),
        parameters=options.parameters,
        limit=None if options.limit is None else float(options.limit),
        timeout=None if options.timeout is None else float(options.timeout),
        jobs=options.jobs,
        cluster=options.cluster,
        store=options.store,
        on_result=options.on_result,
    )


def _taking(
    options: Callable[Given, BatchOptions],
) -> Callable[[Callable[..., Batch]], Callable[Concatenate[str, str | os.PathLike[str], Given], Batch]]:
    """Say in signature and docstring what the options of :func:`batch` are."""
    taken: Any = options
    return lambda batch: declare.stated(batch, taken, list(inspect.signature(batch).parameters.values())[:2])


@_taking(AnyBatchOptions)
def batch(verb: str, suite: str | os.PathLike[str], **given: Any) -> Batch:
    """Ask one question about many plans, each in its own process, as `robust batch` does.

    Not every verb takes every option: methods are of envelopes, back ends of regions and comparisons.

    Args:
        verb: `check`, `envelope`, `region`, or `compare`: CCMMZ against IRR.
        suite: a folder of plans with their problems and domains, or a list of them: lines of DOMAIN PROBLEM PLAN,
            `.json` or `.csv`, see [docs/formats.md].

    Returns:
        A row for each plan; what is wrong with one is in its row. After Ctrl-C, or when time is out, what is there.

    Raises:
        InputError: wrong options, a suite that is empty or malformed, a store that is unusable, no such cluster.
        UnsupportedError: if a cluster is wanted and Dask is not installed.
    """
    if verb not in BATCHES:
        raise InputError(f"unknown verb {verb!r}{did_you_mean(verb, BATCHES)}")
    declare.require_known("batch", given, BATCHES[verb], {})
    with one_question():
        return run_batch(verb, suite, BATCHES[verb](**given))
