"""`robust validate`, `convert`, `execute` and `demo`: plans as planners print them, judged, converted and executed."""

from __future__ import annotations

import logging
import os
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.cli import build, plans
from robust.cli.guard import Action, Run, action, carry_out
from robust.cli.output import answering, print_json
from robust.errors import UNDECIDED, InputError, RefutedError, RobustError, worst
from robust.numbers import plural
from robust.options import declare, verbs
from robust.options.batch import ConvertCommand, DemoCommand, ExecuteCommand
from robust.plan.parameters import specifications
from robust.plan.pddl.forms import read_plan_text
from robust.plan.pddl.reader import read_domain, read_problem
from robust.plan.stn import is_network, parse_stn, write_stn
from robust.plan.timed import TimedPlan, parse_timed_plan
from robust.records import atomic_write

if TYPE_CHECKING:
    from robust.execute import replan
    from robust.execute.convert import Conversion, Converting
    from robust.execute.tree_writer import MadeTree
    from robust.execute.validate import Verdict
    from robust.plan.model import ParametrizedPlan
    from robust.plan.pddl.syntax import Domain, Problem
    from robust.show.console import Console
    from robust.show.validation import JudgedPlan
    from robust.stnu.network import Network

log = logging.getLogger(__name__)
_Files = tuple[Path, Path, Path]


@action(verbs.ValidateCommand)
def validate(options: verbs.ValidateCommand, run: Run) -> int:
    """Is a plan valid as it stands, at the times that it says? If not: what breaks, when, by how much, what would help.

    Any number of plans of one problem, or those of a list. robust check judges all schedules of a network.
    """
    from robust.show import validation

    judged: list[JudgedPlan] = []
    cause = run.several(lambda: _judge_all(options, run, judged), judged)
    status = "complete" if cause is None else cause.value
    run.answer(
        lambda: validation.validate(judged, status, options.separation, options.rounding),
        lambda out: validation.print_verdicts(out, judged, quiet=options.quiet),
    )
    if cause is not None:
        print(f"robust: {cause.message} after {plural(len(judged), 'plan')}", file=sys.stderr)
    return worst([*(plan.exit_code for plan in judged), 0 if cause is None else UNDECIDED])


def _judge_all(options: verbs.ValidateCommand, run: Run, judged: list[JudgedPlan]) -> None:
    from robust.show.validation import JudgedPlan
    from robust.sweeps.batch import listed_files

    domain_of = lru_cache(maxsize=1)(read_domain)  # the last ones are kept: plans of one problem come together

    @lru_cache(maxsize=1)
    def problem_of(domain: Path, problem: Path) -> tuple[Domain, Problem]:
        return domain_of(domain), read_problem(problem, domain_of(domain))

    every: list[_Files] = []
    if options.domain is not None and options.problem is not None:
        problem_of(options.domain, options.problem)  # what is wrong with these is said once
        every = [(options.domain, options.problem, plan) for plan in options.plans]
    elif options.suite is not None:
        every = listed_files(options.suite)
    for number, (domain, problem, plan) in enumerate(every, start=1):
        doing = f"plan {number} of {len(every)}: {plan}"
        run.display.say(doing)
        log.debug(doing)
        try:
            verdict = _judged(options, *problem_of(domain, problem), plan)
        except RobustError as error:
            if len(every) == 1:
                raise
            judged.append(JudgedPlan(domain, problem, plan, error=error))
        else:
            judged.append(JudgedPlan(domain, problem, plan, verdict))
            if verdict.note:
                run.note(f"{verdict.plan}: {verdict.note}")


def _judged(options: verbs.ValidateCommand, domain: Domain, problem: Problem, plan: Path) -> Verdict:
    from robust.execute.validate import read_plan, validate

    timed = read_plan(*read_plan_text(plan), options.plan_number)
    return validate(domain, problem, timed, epsilon=options.separation, tolerance=options.rounding)


# -- convert -----------------------------------------------------------------------------------------------------------


@action(ConvertCommand)
def convert(options: ConvertCommand, run: Run) -> int:
    """Make a plan with a temporal network of a time-triggered plan, and prove it; steps are called n0, n1, ..."""
    from robust.show import execution as show

    if (options.tree is not None or options.stnu is not None) and _is_network(options.plan):
        return _export(options, run)
    timed: TimedPlan | None = None
    made: MadeTree | None = None

    def begin() -> Converting:
        nonlocal timed
        timed, converting = _converting(options, run)
        return converting

    def tell(conversion: Conversion) -> None:
        _show(options, run, conversion, () if timed is None else conversion.notes(timed), made)

    try:
        conversion = run.best(begin, tell)
    except RefutedError as error:
        if not options.json:
            raise
        violations = getattr(error, "violations", ())
        print_json(show.unconverted(options, violations))
        return error.exit_code
    if options.stnu is not None:
        _write_stnu(options, run, conversion.plan)
    if options.tree is not None and timed is not None:
        starts = {f"n{number}": step.time for number, step in enumerate(timed.steps)}
        made = _write_tree(options, run, conversion.plan, starts)
    tell(conversion)
    if options.output is not None:
        run.write(lambda: _write(options, conversion))
    return UNDECIDED if conversion.cut_short else 0


def _is_network(plan: Path) -> bool:
    return str(plan) != "-" and is_network(*read_plan_text(plan))


def _export(options: ConvertCommand, run: Run) -> int:
    """Write the behavior tree, or the network with uncertainty, of a plan that needs no conversion."""
    if options.output is not None:
        kind = "stnu" if options.tree is None else "tree"
        reason = f"is for converted plans; PLAN is a network already, expected --{kind} only"
        raise InputError(reason, declare.place_of("output"))
    plan = run.only(lambda: plans.load(options, run))
    if options.tree is None:
        from robust.show import stnu

        network = _write_stnu(options, run, plan)
        run.answer(
            lambda: stnu.export_document(network), lambda out: out.line(f"network: {network.name}, {network.size}")
        )
        return 0
    from robust.show import execution as show

    made, file = _write_tree(options, run, plan), str(options.tree)
    run.answer(lambda: show.tree_document(made, file), lambda out: out.lines(show.tree_lines(made, file)))
    return 0


def _write_stnu(options: ConvertCommand, run: Run, plan: ParametrizedPlan) -> Network:
    """Write the network with uncertainty of a plan under the box."""
    from robust.cli.certify import read_box
    from robust.qe.box import Box
    from robust.stnu.files import write
    from robust.stnu.graphml import scaled
    from robust.stnu.network import network_of_plan

    output = options.stnu or Path()
    nominal = Box.nominal(plan.parameters)
    box = nominal if options.box is None else read_box(options.box, nominal)
    network = network_of_plan(plan, box, str(output), "Z" if output.suffix.lower() == ".stnu" else "0")
    content, scale = write(network, output)
    run.write(partial(atomic_write, output, content, declare.place_of("stnu")))
    if scale != 1:
        run.note(scaled(output, scale))
    return network


def _write_tree(
    options: ConvertCommand, run: Run, plan: ParametrizedPlan, starts: Mapping[str, Fraction] | None = None
) -> MadeTree:
    """Write a behavior tree of a plan, once it is proved."""
    from robust.execute.tree_writer import make_tree
    from robust.smt.limits import Deadline

    def work() -> MadeTree:
        lag = None if options.lag is None else Fraction(options.lag)
        limit = Deadline.after(run.remaining)
        return make_tree(
            plan, epsilon=options.separation, lag=lag, starts=starts, solver=options.solver, deadline=limit
        )

    made = run.only(work)
    run.write(partial(atomic_write, options.tree or Path(), made.text, declare.place_of("tree")))
    return made


def _show(
    options: ConvertCommand, run: Run, conversion: Conversion, notes: Sequence[str], made: MadeTree | None = None
) -> None:
    """Say what was done; without a file for the plan, print it."""
    from robust.show import execution as show

    if notes:
        run.note(f"{conversion.stn.file}: {'; '.join(notes)}")
    written = {} if options.output is None else {"plan": str(options.output)}
    if options.output is not None and conversion.beside:
        written["parameters"] = str(options.output.with_suffix(".toml"))
    if options.stnu is not None:
        written["stnu"] = str(options.stnu)
    if made is not None:
        written["tree"] = str(options.tree)

    def tell(out: Console) -> None:
        if options.output is None:
            sys.stdout.write(write_stn(conversion.stn))
            sys.stdout.flush()
        told = [
            *show.conversion_lines(conversion, written),
            *([] if made is None else show.tree_lines(made, written["tree"])),
        ]
        for line in () if options.quiet else told:
            if options.output is None:
                print(line, file=sys.stderr)
            else:
                out.line(line)

    run.answer(lambda: show.converted(conversion, written, made), tell)


def _converting(options: ConvertCommand, run: Run) -> tuple[TimedPlan, Converting]:
    from robust.execute.convert import Converting
    from robust.reading import conversion_settings, domain_and_problem

    specs, _ = specifications(options.parameter, options.parameters)
    parsed = domain_and_problem(options.domain, options.problem)
    timed = parse_timed_plan(*read_plan_text(options.plan), options.plan_number)
    settings = conversion_settings(options, specs, run.remaining, run.display.say)
    return timed, Converting(*parsed, timed, settings)


def _write(options: ConvertCommand, conversion: Conversion) -> None:
    """Write the plan, and the parameters that it cannot hold by itself; print what JSON has if it cannot be written."""
    from robust.execute.parametrization import write_specs

    output, stn = options.output or Path(), write_stn(conversion.stn)
    try:
        atomic_write(output, stn, declare.place_of("output"))
        parameters = output.with_suffix(".toml")
        if conversion.beside or parameters.exists():  # which is found there by whoever reads the plan
            atomic_write(parameters, write_specs(conversion.beside), declare.place_of("output"))
    except InputError:
        with answering():
            print("" if options.json else stn, end="")
        raise


# -- execute -----------------------------------------------------------------------------------------------------------


@action(ExecuteCommand)
def execute(options: ExecuteCommand, run: Run) -> int:
    """Execute a plan in simulated worlds, and plan anew from the state reached when an observation leaves the box."""
    runs: list[replan.ReplanningRun] = []
    cause = run.several(lambda: _execute_all(options, run, runs), runs)
    from robust.show import execution as show

    if (picture := options.plot) is not None:
        from robust.draw.gantt import plot_run

        run.write(lambda: plot_run(runs[0], options.executor, picture))

    def tell(out: Console) -> None:
        if options.runs == 1 and runs:
            show.print_run(out, runs[0], options.executor, quiet=options.quiet)
        else:
            show.print_runs(out, runs, options.executor, quiet=options.quiet)
        if cause is not None:
            out.print(f"{cause.message} after {len(runs)} of {options.runs} runs")

    run.answer(lambda: show.execute(options, runs, "complete" if cause is None else cause.value), tell)
    if cause is not None:
        return UNDECIDED
    return 0 if all(not execution.reason for execution in runs) else 1


def _execute_all(options: ExecuteCommand, run: Run, runs: list[replan.ReplanningRun]) -> None:
    from robust.execute import replan

    mission = _mission(options, run)
    run.display.say("preparing the plan")
    prepared = replan.first_plan(mission) if options.plan is None else _prepared(options, mission, run)
    for number in range(options.runs):
        run.display.say(f"run {number + 1} of {options.runs}")
        runs.append(replan.execute(mission, options.seed + number, prepared))


def _mission(options: ExecuteCommand, run: Run) -> replan.Mission:
    from robust.execute.convert import Mode
    from robust.execute.dispatchable import parse_executor
    from robust.execute.planners import create_planner
    from robust.execute.replan import Mission, ReplanningOptions
    from robust.execute.rules import Rules, read_rules
    from robust.irr.exact import BoxMethod
    from robust.reading import domain_and_problem

    specs, beside = specifications(options.parameter, options.parameters, options.plan)
    if beside is not None:
        run.note(f"took the parameters of {beside}")
    settings = ReplanningOptions(
        executor=parse_executor(options.executor),
        mode=Mode(options.mode),
        free_durations=options.free_durations,
        specs=specs,
        relative=options.relative,
        method=BoxMethod(options.method, options.precision, doubling=options.doubling),
        epsilon=options.separation,
        solver=options.solver,
        timeout=run.remaining,
        controllability=options.controllability,
    )
    domain, problem = domain_and_problem(options.domain, options.problem)
    return Mission(
        domain=domain,
        problem=problem,
        planner=None if options.planner is None else create_planner(options.planner, epsilon=settings.epsilon),
        rules=Rules() if options.world is None else read_rules(options.world),
        options=settings,
        replans=options.replans,
        planner_seconds=float(options.planner_limit),
        planning_time=Fraction(options.planning_time),
        drain=not options.stop_running,
    )


def _prepared(options: ExecuteCommand, mission: replan.Mission, run: Run) -> replan.Prepared:
    """The plan in a file: a network, or steps as planners print them."""
    from robust.execute.parametrization import with_deadline, with_relative_widths
    from robust.execute.replan import prepare_plan, prepare_timed
    from robust.plan.load import assemble

    text, file = read_plan_text(options.plan or "-")
    if is_network(text, file):
        network = with_deadline(parse_stn(text, file), options.deadline, declare.place_of("deadline"))
        plan = assemble(mission.domain, mission.problem, network, mission.options.specs)
        return prepare_plan(with_relative_widths(plan) if options.relative else plan, mission.options)
    timed = parse_timed_plan(text, file, options.plan_number)
    # Of re-plans nobody knows by how much later they may end.
    settings = replace(mission.options, deadline=options.deadline, tolerance=options.rounding)
    return prepare_timed(mission.domain, mission.problem, timed, settings, on_note=run.note)


# -- demo --------------------------------------------------------------------------------------------------------------

EXAMPLES = Path(__file__).parents[1] / "examples"


@dataclass(frozen=True)
class _Step:
    """One command of the tour: what to look at, and what to type in the directory of the example."""

    text: str
    command: str
    plan: str

    @property
    def words(self) -> tuple[str, ...]:
        return "domain.pddl", "problem.pddl", self.plan


_TOUR: tuple[tuple[str, str, tuple[_Step, ...]], ...] = (
    (
        "two_sample_navigation",
        "A rover drives to two sites by daylight, takes a sample at each and returns, on one battery.",
        (
            _Step(
                "Is this plan valid? Not for one schedule that was tried, but for every schedule that it allows:",
                "check",
                "plan.stn",
            ),
            _Step(
                "The same plan, but the rover may rest up to 20 minutes. Its earliest schedule works, others fail:",
                "check",
                "plan-flexible-wait.stn",
            ),
            _Step(
                "Driving takes longer or shorter than planned. For which durations, in any combination, is the first "
                "plan still valid?",
                "envelope",
                "plan.stn",
            ),
        ),
    ),
    (
        "generator",
        "A generator burns fuel while canisters are poured into its tank, which must neither overflow nor run dry.",
        (_Step("When may the first two pourings start, whichever comes first?", "envelope", "plan.stn"),),
    ),
)
_NEXT = (
    ("robust check --help", "values and ranges of parameters, all obligations, JSON, SMT-LIB"),
    ("robust envelope --help", "methods, other quantities as parameters, plots, time limits"),
    ("robust envelope ... --plot box.svg", "draw the box and how the search came to it"),
    ("robust region --help", "all valid parameter values, exactly"),
    ("robust compare --help", "the exact region beside the boxes of all methods"),
)


@action(DemoCommand, epilog=None)
def demo(options: DemoCommand, run: Run) -> int:
    """Take a tour: check and envelope on examples that come with the program."""
    with answering():
        return _take_tour(run.console(), run, options.color)
    return 0  # whoever read it has left


def _take_tour(out: Console, run: Run, color: str) -> int:
    from robust.show.console import Text

    def show_command(*words: str) -> None:
        out.line(Text.assemble(("$ ", "dim"), (shlex.join(words), "cyan")))

    for name, text, steps in _TOUR:
        directory = EXAMPLES / name
        out.line(text, "bold")
        show_command("cd", str(directory))
        with _inside(directory):
            for step in steps:
                out.print()
                out.line(step.text)
                show_command("robust", step.command, *step.words)
                if _carry_out(step, run, color) == UNDECIDED:
                    return UNDECIDED
        out.print()
    out.print(Text("Where to go next", style="bold"))
    for command, what in _NEXT:
        out.line(Text.assemble("  ", (f"{command:<36}", "cyan"), what))
    return 0


def _carry_out(step: _Step, run: Run, color: str) -> int:
    action: Action[Any] = plans.check if step.command == "check" else plans.envelope
    given = build.read_options(action.options, step.words) or {}
    return carry_out(run.guard, action, {**given, "color": color})


@contextmanager
def _inside(directory: Path) -> Iterator[None]:
    """So that commands can be shown as short as they would be typed."""
    before = Path.cwd()
    os.chdir(directory)
    try:
        yield
    finally:
        os.chdir(before)
