"""`robust check`, `envelope`, `region`, `compare`, `risk` and `repair`: questions about a plan, and their answers."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from robust import api, errors, records
from robust.cli.guard import Run, action
from robust.options import declare, shared, verbs
from robust.plan.pddl.forms import read_plan_text

if TYPE_CHECKING:
    from pathlib import Path

    from robust.execute.controllability import ControllabilityReport
    from robust.irr.check import CheckResult, Counterexample
    from robust.irr.compare import Comparison
    from robust.irr.quantities import Cost, QuantityChange
    from robust.irr.repair import Repair, RepairSearch
    from robust.irr.search import EnvelopeResult
    from robust.irr.slices import EnvelopeRegion
    from robust.options.batch import ConvertCommand
    from robust.plan.model import ParametrizedPlan
    from robust.probability.measure import Bounds
    from robust.probability.risk import RiskResult
    from robust.qe.compute import RegionResult
    from robust.searching import AnytimeSearch
    from robust.show.console import Console
    from robust.sweeps.rank import Ranking

HINT_SECONDS = 1
"""Of a processor, for the repair that a refutation ends with."""
HINT_PATIENCE = 10.0
"""Seconds on the clock for the same, where other processes take turns."""


def load(options: shared.AskCommand | ConvertCommand, run: Run, *, nominal_needed: bool = True) -> ParametrizedPlan:
    """The plan that a command is about; making a network of steps may take half of the time."""
    from robust.reading import ReadOptions, load_plan

    given = {name: getattr(options, name) for name in ReadOptions.declarations}
    if run.remaining is not None:
        given["timeout"] = run.remaining / 2
    return load_plan(
        options.domain,
        options.problem,
        options.plan,
        parameters=options.parameter,
        parameter_file=options.parameters,
        nominal_needed=nominal_needed,
        on_note=run.note,
        on_progress=run.display.say,
        **given,
    )


@action(verbs.CheckCommand)
def check(options: verbs.CheckCommand, run: Run) -> int:
    """Is the plan valid for every schedule that its network allows? If not, show one that fails."""
    plan: ParametrizedPlan | None = None

    def begin() -> AnytimeSearch[CheckResult]:
        nonlocal plan
        plan = load(options, run)
        run.display.say("encoding")
        return api.searching_check(plan, options.changed(timeout=run.remaining, on_obligation=run.display.obligation))

    result = run.best(begin, run.show)
    hinted = plan is not None and options.tree is None and not options.quiet
    if plan is not None and hinted and result.answer.value == "refuted" and not result.cut_short:
        result = replace(result, repair=_repair(options, run, plan, result))
    run.show(result)
    return errors.exit_code_of(result.answer.value)


def _repair(
    options: verbs.CheckCommand, run: Run, plan: ParametrizedPlan, refuted: CheckResult
) -> tuple[QuantityChange, ...] | None:
    """The least change of bounds for what was refuted, if it is found soon, in a copy of this process."""
    from robust.smt.limits import Deadline, from_copy

    asked = verbs.RepairOptions(require=refuted.box.intervals, epsilon=options.epsilon, solver=options.solver)
    remaining = run.remaining
    patience = HINT_PATIENCE if remaining is None else min(remaining, HINT_PATIENCE)

    def work() -> Repair:
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (HINT_SECONDS, HINT_SECONDS))
        return api.searching_repair(plan, asked).run()

    def look() -> tuple[QuantityChange, ...] | None:
        try:
            result: Repair = from_copy(work, Deadline.after(patience), "the search for a repair")
        except errors.RobustError:
            return None  # the refutation stands without
        return result.changes if result.status.value == "optimal" else None

    return run.also("looking for a repair", look)


@action(verbs.EnvelopeCommand)
def envelope(options: verbs.EnvelopeCommand, run: Run) -> int:
    """How far may parameters deviate, all at once, before the plan can fail? Ctrl-C prints the best box so far."""
    from robust.show import plan_documents
    from robust.show.regions import NOTHING_BESIDE, print_envelope

    plan: ParametrizedPlan | None = None
    beside = NOTHING_BESIDE
    wanted = options.controllability is not None
    exported: str | None = None

    def begin() -> AnytimeSearch[EnvelopeResult]:
        nonlocal plan
        about_nominal = options.plot is not None or options.controllability is not None
        plan = load(options, run, nominal_needed=options.from_nominal or about_nominal)
        run.display.say("encoding, then checking the nominal values")
        return api.searching_envelope(plan, options.changed(timeout=run.remaining, on_step=run.display.step))

    def show(result: EnvelopeResult) -> None:
        def tell(out: Console) -> None:
            if exported is not None and options.output is None:
                out.file.write(exported)
            else:
                print_envelope(out, result, extra, quiet=options.quiet)

        extra = beside
        if plan is not None and result.verified:
            extra = replace(beside, probability=_probability(options, plan, result))
        run.answer(lambda: plan_documents.envelope(result, extra, controllability=wanted), tell)

    result = run.best(begin, show)
    if plan is not None and result.status.value == "invalid":
        beside = replace(beside, counterexample=_counterexample(options, run, plan))
    if plan is not None and wanted and result.verified:
        beside = replace(beside, controllability=_controllability(options, run, plan, result))
    if plan is not None and options.export is not None and result.verified:
        exported = _exported(options, run, plan, result, beside.controllability)
    show(result)
    if exported is not None and (output := options.output) is not None:
        run.write(partial(records.atomic_write, output, exported, declare.place_of("output")))
    if (picture := options.plot) is not None and result.verified:
        run.write(partial(result.plot, picture))
    missing = options.export is not None and result.verified and exported is None
    return errors.UNDECIDED if missing else errors.exit_code_of(result.status.value)


def _exported(
    options: verbs.EnvelopeCommand,
    run: Run,
    plan: ParametrizedPlan,
    result: EnvelopeResult,
    report: ControllabilityReport | None,
) -> str | None:
    """What is exported: of a box that is to be controllable, the part of it that is; None if that is not known."""
    from robust.show.exports import export

    kind = options.controllability
    if kind is None:
        return export(plan, result, options.export or "")
    if report is None or report.shrunk is None:
        reason = "no time was left" if report is None else report.failure
        run.note(f"nothing is exported: no part of the box is known that is controllable as wanted ({reason})")
        return None
    box = report.shrunk.box
    old = result.box
    kept = {face: stop for face, stop in result.stops.items() if box[face[0]].end(face[1]) == old[face[0]].end(face[1])}
    return export(plan, replace(result, box=box, stops=kept), options.export or "", controllable=kind)


def _probability(options: verbs.EnvelopeCommand, plan: ParametrizedPlan, result: EnvelopeResult) -> Bounds | None:
    """How probable the box is, where parameters are random."""
    if options.method != "risk":
        return None
    from robust.probability.measure import box_probability

    return box_probability(result.box, api.box_distributions(plan, options))


def _counterexample(options: verbs.EnvelopeCommand, run: Run, plan: ParametrizedPlan) -> Counterexample | None:
    """What happens at the nominal point of an invalid plan; None if there is no schedule, or no time left."""
    epsilon, encoding, solver = options.epsilon, options.encoding, options.solver
    checked = run.also(
        "looking for a schedule that fails",
        lambda: api.check(plan, epsilon=epsilon, encoding=encoding, solver=solver, timeout=run.remaining),
    )
    if checked is None or checked.answer.value != "refuted":
        return None
    return next(iter(checked.counterexamples.values()), None)


def _controllability(
    options: verbs.EnvelopeCommand, run: Run, plan: ParametrizedPlan, result: EnvelopeResult
) -> ControllabilityReport | None:
    """What a dispatcher may not know; None if that was interrupted."""
    from robust.execute.controllability import Objective, assess

    kind, solver, optimal = options.controllability or "", options.solver, options.method == "optimal"
    objective = Objective(options.separation, options.encoding, optimal, options.contain_nominal)
    return run.also(
        "asking whether the box is controllable",
        lambda: assess(plan, result.box, kind, solver=solver, timeout=run.remaining, objective=objective),
    )


@action(verbs.RegionCommand)
def region(options: verbs.RegionCommand, run: Run) -> int:
    """For exactly which parameter values is the plan valid? Out of time, an outer and an inner bound are printed."""
    from robust.show import region_documents, regions

    search: EnvelopeRegion | None = None
    counts = {"bad": 0, "good": 0}

    def progress(kind: str) -> None:
        if not run.display.is_shown:
            return  # the share takes milliseconds
        counts[kind] += 1
        share = search and search.open_share
        known = f"polyhedra of bad values: {counts['bad']}, of good values: {counts['good']}"
        run.display.say(f"{known}, open: {float(share.value):.1%}" if share else known)

    def begin() -> AnytimeSearch[RegionResult]:
        nonlocal search
        plan = load(options, run, nominal_needed=False)
        if options.plot is not None:
            from robust.draw.plane import shown_axes

            shown_axes(plan, options.axes or ())
        run.display.say("encoding")
        callbacks = {"on_piece": lambda _: progress("bad"), "on_cell": lambda _: progress("good")}
        search = api.searching_region(plan, options.changed(timeout=run.remaining, **callbacks))
        return search

    def show(result: RegionResult) -> None:
        def tell(out: Console) -> None:
            if options.latex:
                regions.print_latex(out, result)
            else:
                regions.print_region(out, result, quiet=options.quiet)

        run.answer(lambda: region_documents.region(result), tell)

    result = original = run.best(begin, show)
    if run.guard.cause is None:  # else there is no time left for a shorter form
        simpler = run.also("simplifying", lambda: regions.formed(original, options.form))
        result = original if simpler is None else simpler
    show(result)
    if options.plot is not None:
        run.write(partial(result.plot, options.plot, axes=options.axes or ()))
    return 0 if result.is_exact else 3


@action(verbs.CompareCommand)
def compare(options: verbs.CompareCommand, run: Run) -> int:
    """How much of the exact region does each box cover, and what breaks just outside each of its faces?

    The boxes are that of IRR, the widened one, and the widest one, which CCMMZ asks for, with and without the nominal
    point. Many plans, CCMMZ against IRR: robust batch compare.
    """

    def begin() -> AnytimeSearch[Comparison]:
        plan = load(options, run)
        if options.plot is not None:
            from robust.draw.plane import shown_axes

            shown_axes(plan, options.axes or ())
        return api.searching_compare(plan, options.changed(timeout=run.remaining, on_stage=run.display.say))

    result = run.reply(begin)
    if options.plot is not None and result.region is not None:
        run.write(partial(result.plot, options.plot, axes=options.axes or ()))
    if options.html is not None:
        run.write(partial(_write_page, options, run, result))
    return errors.exit_code_of(result.status.value)


def _write_page(options: verbs.CompareCommand, run: Run, result: Comparison) -> None:
    """The interactive page; it names what breaks as far as that is found in the time that is left."""
    from robust.draw.interactive import comparison_page, shown_region
    from robust.qe.compute import what_breaks

    breaks = None
    if shown_region(result)[0] is not None and options.html is not None:
        breaks = run.also(
            "looking for what breaks where",
            lambda: what_breaks(
                result.plan, epsilon=options.separation, solver=options.solver, timeout=_page_seconds(run, result)
            ),
        )
    page = comparison_page(result, breaks, name=options.plan.name, epsilon=options.separation)
    records.atomic_write(options.html or "", page, declare.place_of("html"))


def _page_seconds(run: Run, result: Comparison) -> float:
    """The seconds for the page: as long as everything before took, but at least a minute."""
    most = max(60.0, result.seconds)
    return most if run.remaining is None else min(most, run.remaining)


@action(verbs.RiskCommand)
def risk(options: verbs.RiskCommand, run: Run) -> int:
    """How likely does the plan succeed if its parameters are random? Ctrl-C prints the bounds so far."""

    def begin() -> AnytimeSearch[RiskResult]:
        plan = load(options, run, nominal_needed=False)
        run.display.say("encoding")
        callbacks = {"on_bounds": run.display.bounds, "on_stage": run.display.say}
        return api.searching_risk(plan, options.changed(timeout=run.remaining, **callbacks))

    result = run.reply(begin)
    if options.plot is not None:
        run.write(partial(result.plot, options.plot))
    return 3 if result.cut_short else 0


@action(verbs.RankCommand)
def rank(options: verbs.RankCommand, run: Run) -> int:
    """Which of several plans of one problem bears most, if all its durations may be longer or shorter at once?

    With distributions, which is most likely in time? A log with several plans counts as several.
    """

    def begin() -> AnytimeSearch[Ranking]:
        asked = options.changed(timeout=run.remaining, on_plan=run.display.say)
        return api.searching_rank(options.domain, options.problem, options.plans, asked)

    result = run.reply(begin)
    if result.cut_short:
        return errors.UNDECIDED
    return 0 if any(plan.fitness.value == "valid" for plan in result.plans) else 1


@action(verbs.LearnCommand)
def learn(options: verbs.LearnCommand, run: Run) -> int:
    """How long do actions take, by logs of their runs, and within which limits will they end?

    No distribution is assumed: a limit is an observed duration, so long that it covers the wanted share of future runs
    with the wanted confidence, if runs are independent and alike; whether later runs differ is tested.
    """
    from robust.show.presenting import print_result

    asked = {name: getattr(options, name) for name in verbs.LearnOptions.declarations}
    result = run.only(lambda: api.learn(options.logs, **asked))

    def tell(out: Console) -> None:
        if options.as_box:
            out.line(result.box_text().rstrip("\n"))
        else:
            print_result(out, result, quiet=options.quiet)

    run.answer(result.as_dict, tell)
    if options.output is not None:
        run.write(partial(records.atomic_write, options.output, result.world(), declare.place_of("output")))
    return 0


@action(verbs.RepairCommand)
def repair(options: verbs.RepairCommand, run: Run) -> int:
    """What is the least change after which a plan is valid for every schedule that its network then allows?

    What changes are bounds of the network, nominal values, or both; with --require, the plan is valid for all these
    values of parameters as well. Ctrl-C prints the best repair so far.
    """
    from robust.plan.stn import is_network
    from robust.show import repairs as show

    source = "" if options.output is None else read_plan_text(options.plan)[0]
    if options.output is not None and not is_network(source, str(options.plan)):
        raise errors.InputError(
            f"found steps in {options.plan}, expected a network (.stn): convert them first by robust convert",
            declare.place_of("output"),
        )

    def begin() -> RepairSearch:
        plan = load(options, run)
        run.display.say("encoding")
        return api.searching_repair(plan, options.changed(timeout=run.remaining, on_repair=better))

    def better(cost: Cost) -> None:
        run.display.say(f"best so far: {show.price(cost, options.count)}")

    def tell(result: Repair) -> None:
        written = None if options.output is None or result.plan is None else options.output
        run.answer(
            lambda: show.repair_document(result, written),
            lambda out: show.print_repair(out, result, written, quiet=options.quiet),
        )

    result = run.best(begin, tell)
    tell(result)
    if options.output is not None and result.plan is not None:
        text = _text(source, options.plan, result.changes)
        run.write(partial(records.atomic_write, options.output, text, declare.place_of("output")))
    return errors.exit_code_of(result.status.value)


def _text(source: str, file: Path, changes: tuple[QuantityChange, ...]) -> str:
    """The plan as it was written, but for what changes."""
    from robust.plan.load import BoundNumber, rewritten

    return rewritten(source, str(file), {BoundNumber(change.location, change.part): change.new for change in changes})
