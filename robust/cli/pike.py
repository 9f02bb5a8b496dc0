"""`robust pike`: plans with choices.

`robust pike run --stdio`: any process drives an executive through lines of JSON, in its own time or in real time.
"""

from __future__ import annotations

import gc
import queue
import sys
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from functools import partial
from math import floor
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import robust
from robust.backends import DRAKE
from robust.cli import guard, output
from robust.cli.guard import Run, action
from robust.cli.lines import LineReader, LineWriter, listening
from robust.errors import UNDECIDED, InputError, Location, SolverError, exit_code_of
from robust.options import declare
from robust.options import pike as asking
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

if TYPE_CHECKING:
    from robust.cli.page import PageServer
    from robust.pike_bridge.action_model import Instance
    from robust.pike_bridge.envelopes.parameters import ParametricPlan
    from robust.pike_bridge.envelopes.search import LabeledRegion
    from robust.pike_bridge.model import TeamPlan
    from robust.pike_bridge.online.field import TeamExecutive
    from robust.pike_bridge.online.progress import Progress
    from robust.pike_bridge.online.semantic import Reasoner
    from robust.pike_bridge.online.service import Request
    from robust.pike_bridge.online.world import ExecutionRecord
    from robust.searching import AnytimeSearch
    from robust.show.pike import PikePlot
    from robust.show.pike_envelopes import Cells


Asked = TypeVar("Asked", bound=asking.Staged)


def load(options: asking.TeamPlanFile) -> TeamPlan:
    """The plan of a command."""
    from robust.pike_bridge.conditional import read_any

    return read_any(options.file, epsilon=options.separation)


# -- check, compile and plot -------------------------------------------------------------------------------------------


def _within(options: Asked, run: Run) -> Asked:
    """The options with the time that remains, and with each stage displayed."""
    return options.changed(timeout=run.remaining, on_stage=run.display.say)


@action(asking.PikeCheckCommand)
def check(options: asking.PikeCheckCommand, run: Run) -> int:
    """Is there a correct execution of a plan with choices, given some of the choices? If so, show one."""
    if options.cross:
        return _cross(options, run)
    if options.patience:
        return _patience(options, run)
    if options.controllable:
        return _controllable(options, run)
    result = run.reply(lambda: robust.pike.searching_check(load(options), _within(options, run)))
    verdict = result.verdict.value
    return exit_code_of(verdict) if result.complete or verdict == "refuted" else UNDECIDED


def _cross(options: asking.PikeCheckCommand, run: Run) -> int:

    crossed = run.reply(lambda: robust.pike.searching_differences(load(options), _within(options, run)))
    return 1 if crossed.outcome is not None and not crossed.outcome.agree else exit_code_of(crossed.status)


def _patience(options: asking.PikeCheckCommand, run: Run) -> int:

    asked = asking.MomentsOptions(assume=options.assume, solver=options.solver, timeout=run.remaining)
    moments = run.reply(lambda: robust.pike.searching_moments(load(options), asked))
    return 1 if moments.feasible is False else exit_code_of(moments.status)


def _controllable(options: asking.PikeCheckCommand, run: Run) -> int:

    found = run.reply(
        lambda: robust.pike.searching_controllability(
            robust.pike.parametric(options.file, options), _within(options, run)
        )
    )
    return UNDECIDED if found.cut_short else exit_code_of(found.verdict.value)


@action(asking.PikeCompileCommand)
def compile_(options: asking.PikeCompileCommand, run: Run) -> int:
    """Compile a plan with choices for execution: sizes, and seconds of each stage."""
    sizes = run.reply(lambda: robust.pike.searching_sizes(load(options), _within(options, run)))
    return exit_code_of(sizes.status)


@action(asking.ChanceCommand)
def chance(options: asking.ChanceCommand, run: Run) -> int:
    """How likely is it that people's choices leave a correct execution, by the probabilities in the plan?"""
    result = run.reply(lambda: robust.pike.searching_chance(load(options), _within(options, run)))
    return exit_code_of(result.status)


@action(asking.PikePlotCommand)
def plot(options: asking.PikePlotCommand, run: Run) -> int:
    """Draw events, activities, choices and guards of a plan; with assumptions, only what they leave."""
    from robust.show import pike
    from robust.show.documents import document

    drawn, draw = run.only(lambda: _drawing(options, run))
    run.answer(lambda: document(drawn), lambda out: pike.print_plot(out, drawn, quiet=options.quiet))
    run.write(lambda: run.only(draw))
    return 0


def _drawing(options: asking.PikePlotCommand, run: Run) -> tuple[PikePlot, Callable[[], object]]:
    """What there is to see in a drawing of the plan, and what draws it."""
    from robust.pike_bridge.semantics import restrict
    from robust.show import pike

    plan = load(options)
    plan = restrict(plan, robust.pike.assumed(plan, options.assume))
    links = None
    if options.links:
        from robust.pike_bridge.causal import augment
        from robust.pike_bridge.distance_graph import StructuralPrecedence

        run.display.say("links")
        links = augment(plan, StructuralPrecedence(plan.network, epsilon=plan.separation)).links
    from robust.draw.tpnu import DrawnLink, plot_network

    arrows = [DrawnLink(link.producer.event, link.consumer.first, link.text) for link in links or ()]
    draw = partial(plot_network, plan.network, options.output, links=arrows, epsilon=options.separation)
    drawn = pike.PikePlot(
        plot=str(options.output),
        events=len(plan.network.events),
        activities=len(plan.network.activities),
        choices=len(plan.network.choices),
        links=None if links is None else len(links),
    )
    return drawn, draw


# -- run ---------------------------------------------------------------------------------------------------------------


@action(asking.PikeRunCommand)
def run(options: asking.PikeRunCommand, run: Run) -> int:
    """Execute a plan with choices: dispatch, recognise intent, adapt, watch for what goes wrong."""
    if options.stdio:
        from robust.pike_bridge.online.reasoners import without_states

        seen = without_states if options.reasoner == DRAKE else lambda plan: plan
        return serve(run, options, lambda: seen(load(options)))

    def begin() -> AnytimeSearch[ExecutionRecord]:
        search = robust.pike.searching_execution(load(options), options.changed(timeout=run.remaining))
        run.display.say("executing")
        return search

    record = run.reply(begin)
    if options.plot is not None:
        run.write(partial(record.plot, options.plot))
    return exit_code_of(record.ending.value)


# -- envelopes ---------------------------------------------------------------------------------------------------------


def _parametric(options: asking.PikeRegionCommand | asking.PikeEnvelopeCommand) -> ParametricPlan:
    """The plan with its parameters; InputError if there are none, or one is wrong."""
    plan = robust.pike.parametric(options.file, options)
    if not plan.parameters:
        raise InputError(
            "found no parameters, expected some: --parameter duration:ACTIVITY, or a file",
            declare.place_of("parameters"),
        )
    if options.plot is not None:
        from robust.draw.plane import shown_team_axes

        shown_team_axes(plan, tuple(options.axes or ()))
    return plan


@action(asking.PikeRegionCommand)
def region(options: asking.PikeRegionCommand, run: Run) -> int:
    """For which durations and limits does each choice of a plan lead to a correct execution?"""
    from robust.show import pike_envelopes as show

    count, drawn = 0, tuple(options.axes or ())

    def on_piece(_piece: object) -> None:
        nonlocal count
        count += 1
        run.display.say(f"polyhedra: {count}")

    cells: Cells | None = None

    def answer(result: LabeledRegion) -> None:
        run.answer(
            lambda: show.region_document(result, cells), lambda out: show.print_region(out, result, quiet=options.quiet)
        )

    def asked() -> asking.PikeRegionOptions:
        return options.changed(timeout=run.remaining, on_piece=on_piece)

    result = run.best(lambda: robust.pike.searching_region(_parametric(options), asked()), answer)
    if not result.cut_short and (options.json or options.plot is not None):
        cells = run.also("cutting", lambda: _cells(result, run))
    answer(result)
    if options.plot is not None:
        from robust.draw.plane import plot_cells

        run.write(partial(plot_cells, result, cells, options.plot, drawn))
    if result.cut_short:
        return exit_code_of(result.status.value)
    return 0 if result.pieces else 1


def _cells(result: LabeledRegion, run: Run) -> Cells | None:
    """The region cut by what is possible; None if there is no time."""
    try:
        return result.exactly(Deadline.after(run.remaining))
    except OutOfTimeError:
        return None


@action(asking.PikeEnvelopeCommand)
def envelope(options: asking.PikeEnvelopeCommand, run: Run) -> int:
    """How far may durations and limits of a plan with choices deviate: for some choices, or whatever people choose?"""
    result = run.reply(lambda: robust.pike.searching_envelope(_parametric(options), _within(options, run)))
    if options.plot is not None and result.combinations:
        run.write(partial(result.plot, options.plot, axes=tuple(options.axes or ())))
    return exit_code_of(result.status.value)


# -- new ---------------------------------------------------------------------------------------------------------------


def _new(options: asking.PikeNewCommand) -> Instance:
    from robust.pike_bridge import builder
    from robust.pike_bridge.action_model import shipped
    from robust.plan.pddl.forms import read_text

    match options.kind:
        case asking.K_INTENTS:
            return builder.k_intents(options.structure, options.seed).instance
        case asking.SAT if options.cnf is not None:
            return builder.satisfiability(builder.read_dimacs(read_text(options.cnf), str(options.cnf)))
        case asking.SAT:
            variables, clauses = options.structure
            return builder.satisfiability(builder.random_clauses(variables, clauses, options.seed))
        case kind:
            return shipped(kind)


@action(asking.PikeNewCommand)
def new(options: asking.PikeNewCommand, run: Run) -> int:
    """Write an example plan with choices and its PDDL files, and suggest what to try next."""
    from robust.show import pike as show

    def write() -> tuple[Instance, Path]:
        instance = _new(options)
        name = options.name or instance.name
        files = [options.output / file for file in (f"{name}.tpnu.json", "domain.pddl", "problem.pddl")]
        declare.refuse_replacing(files, declare.place_of("output"), force=options.force)
        return instance, instance.write(options.output, name)

    instance, path = run.only(write)
    run.answer(
        lambda: show.new_document(instance, path), lambda out: show.print_new(out, instance, path, quiet=options.quiet)
    )
    return 0


_TOLERANCE = Fraction(1)
"""Seconds by which decisions in real time may be late, for thinking and writing, and still count as on time."""
_LOOK = 0.05
"""Seconds between two looks for signals and the deadline, in real time."""


def serve(run: guard.Run, options: asking.PikeRunCommand, load: Callable[[], TeamPlan]) -> int:
    """Serve until the input ends; the exit code says how the execution ended.

    Args:
        load: reads the plan.

    Raises:
        RobustError: wrong options or files, or a journal that does not fit or cannot be written.
        GivenUpError: if interrupted or out of time before the plan was read.
    """
    server = _Server(run, options)
    run.only(lambda: server.prepare(load))
    try:
        return server.serve()
    finally:
        server.close()


class _Server:
    def __init__(self, run: guard.Run, options: asking.PikeRunCommand) -> None:
        self._run = run
        self._options = options
        self._rate = Fraction(options.rate or 1) if options.clock == "real" else None
        """Seconds that a unit of time lasts, in real time; None: messages give the time."""
        self._deadline = Deadline.after(run.remaining)

    def prepare(self, load: Callable[[], TeamPlan]) -> None:
        """Read the plan and the journal, and make what decides."""
        from robust.pike_bridge.likelihood import LikelyChoices
        from robust.pike_bridge.online.field import FieldExecutive
        from robust.pike_bridge.online.reasoners import make_reasoner
        from robust.pike_bridge.online.service import Journal, Service

        if sys.stdin is None:  # closed by the caller, as in `robust ... <&-`
            raise InputError("standard input is closed; send lines of JSON", Location("--stdio"))
        self._reader = LineReader(sys.stdin.fileno())
        sys.stdout.flush()
        self._writer = LineWriter(sys.stdout.fileno(), lambda: self._run.guard.cause is not None, self._deadline)
        plan, options = load(), self._options
        solver, deadline = options.solver, self._deadline
        self._journal = None if options.journal is None else Journal(options.journal, plan)
        reasoner: Callable[[Progress], Reasoner] = make_reasoner(options.deciding, solver=solver, deadline=deadline)
        if options.strategy:
            from robust.pike_bridge.game.following import StrategyReasoner, find_strategy

            found = find_strategy(plan, solver=solver, deadline=deadline, on_stage=self._run.display.say)
            reasoner = partial(StrategyReasoner, strategy=found, solver=solver)
        wanted = options.chance
        likely = None if wanted is None else LikelyChoices(plan, Fraction(wanted), solver=solver, deadline=deadline)
        self._service = Service(
            FieldExecutive(
                plan,
                reasoner,
                early=options.early,
                preference=likely,
                patience=options.margin,
                flexible=options.rank == "flexible",
                solver=solver,
                budget=options.thinking,
                deadline=deadline,
            ),
            self._journal,
            solver=solver,
            likely=likely,
            deadline=deadline,
            # Signals and the time limit interrupt there; elsewhere they wait until what is written is written.
            thinking=lambda: self._run.working(self._on_stuck),
            tolerance=Fraction(0) if self._rate is None else _TOLERANCE / self._rate,
        )
        self._page = _TeamPage.asked_for(self._run, options, plan)
        gc.freeze()  # garbage collection looks at nothing of this again, so that its pauses are short
        self._deadline.enforce()

    def close(self) -> None:
        """Let others have the journal."""
        if self._page is not None:
            self._page.server.close()
        if self._journal is not None:
            self._journal.close()

    def serve(self) -> int:
        """Until the input ends, or something else ends it; returns the exit code."""
        from robust.pike_bridge.online.progress import Succeeded

        try:
            self._announce(self._service.greet())
            if self._rate is None:
                self._serve_given_time()
            else:
                self._serve_real_time(self._rate)
        except BrokenPipeError as error:
            output.drop_output(error)
        except InputError as error:
            self._writer.write_last({"kind": "error", "line": None, "message": str(error)})
            raise
        except OutOfTimeError as stopped:
            if stopped.reason is not None:
                raise SolverError(stopped.reason) from stopped
            self._end("timeout")
        except KeyboardInterrupt:
            self._end("timeout" if self._run.timed_out else "interrupted")
        else:
            self._end("waiting")
        if not self._service.ended:
            return UNDECIDED
        return 0 if isinstance(self._service.executive.outcome, Succeeded) else 1

    def _announce(self, answers: Iterable[dict[str, Any]]) -> None:
        """Write an answer, object by object as it becomes known."""
        for answer in answers:
            self._writer.write(answer)
            if self._page is not None:
                self._page.note(answer)
        if self._page is not None:
            self._page.show(self._service.executive)

    def _ponder(self, is_waited_for: Callable[[], bool]) -> None:
        """Where nobody waits for an answer, find out for the page which values choices may still have."""
        executive = self._service.executive
        while self._page is not None and not is_waited_for():
            choice = self._page.unknown(executive)
            if choice is None:
                return
            self._page.learn(choice, executive.possible_values(choice))
            self._page.show(executive)

    def _read(self) -> Request | None:
        """The next request that is not an empty line; None at the end of the input."""
        from robust.pike_bridge.online.service import INPUT, Request, read_request

        timed = self._rate is None
        while True:
            try:
                text = self._reader.read(self._deadline if timed else NEVER)
            except InputError as error:
                number = self._reader.number
                return Request(number, f"{Location(INPUT, number)}: {error}")
            if text is None:
                return None
            if text.strip():
                return read_request(text, self._reader.number, self._service.executive.plan, timed=timed)

    def _serve_given_time(self) -> None:
        while True:
            with self._run.working():
                while self._page is not None and not self._reader.wait(_LOOK):
                    self._ponder(lambda: self._reader.wait(0))
                request = self._read()
            if request is None:
                return
            self._announce(self._service.answer(request))

    def _serve_real_time(self, rate: Fraction) -> None:
        """What has come is heard, as of when it came, before what is due is done."""
        from robust.execute.drive import WallClock

        grid, clock = self._service.executive.progress.grid, WallClock(rate, self._service.time)

        def on_grid(time: Fraction) -> Fraction:
            """Rounded down: what is due at a time on the grid is late by less than a step then, not early."""
            return floor(time / grid) * grid

        def read() -> tuple[Fraction, Request] | None:
            """The next request, and when it arrived."""
            request = self._read()
            return None if request is None else (clock.now(), request)

        inbox = listening(read)
        closed = False
        while not closed:
            self._run.enforce(self._deadline)
            wake = self._service.wake
            try:
                arrived = inbox.get(timeout=_LOOK if wake is None else min(_LOOK, max(0, clock.seconds_until(wake))))
            except queue.Empty:
                self._announce(self._service.due(on_grid(clock.now())))
                with self._run.working(self._on_stuck):
                    self._ponder(lambda: not inbox.empty())
                continue
            match arrived:
                case OSError():
                    raise arrived
                case None:
                    self._announce(self._service.due(on_grid(clock.now())))
                    closed = True
                case (time, request):
                    self._announce(self._service.due(on_grid(time)))
                    self._announce(self._service.answer(request, on_grid(time)))

    def _end(self, outcome: str) -> None:
        """The last line; where the execution has ended it has been written before."""
        if not self._service.ended:
            self._writer.write_last(self._service.end(outcome))

    def _on_stuck(self) -> bool:
        """A solver does not heed the signal: the answer comes from another thread, and the process ends."""
        self._end(self._run.guard.why().value)
        return True


class _TeamPage:
    """What the page shows of a plan with choices."""

    def __init__(self, server: PageServer, rate: Fraction | None) -> None:
        from robust.draw.live import LastWords

        self.server, self._rate, self._words = server, rate, LastWords()
        self._possible: dict[str, tuple[str, ...]] = {}
        self._known_of: object = None

    @classmethod
    def asked_for(cls, run: guard.Run, options: asking.PikeRunCommand, plan: TeamPlan) -> _TeamPage | None:
        """The page that options ask for, if they do."""
        if options.page is None:
            return None
        from robust.cli.page import page_for

        rate = Fraction(options.rate or 1) if options.clock == "real" else None
        return cls(page_for(run, options.page, options.page_host, f"{plan.name}: what is still possible"), rate)

    def note(self, answer: Mapping[str, Any]) -> None:
        """Keep what an answer says."""
        from robust.draw.live import words_of

        said = words_of(answer)
        if said is not None:
            self._words.add(Fraction(answer.get("time") or 0), *said)

    def unknown(self, executive: TeamExecutive) -> str | None:
        """An open choice of which it is not known what is still possible; None if nobody wants to know."""
        if executive.ended or not self.server.is_watched:
            return None
        open_choices = (name for name in executive.plan.network.domains if name not in executive.progress.chosen)
        return next((name for name in open_choices if name not in self._possible), None)

    def learn(self, choice: str, values: tuple[str, ...]) -> None:
        """Which values are possible now."""
        self._possible[choice] = values

    def show(self, executive: TeamExecutive) -> None:
        """Show how things are now; what was possible before may not be so any more."""
        from robust.draw.live import TeamMoment

        progress = executive.progress
        state = (progress.now, len(progress.times), len(progress.chosen))
        if state != self._known_of:
            self._known_of = state
            self._possible.clear()
        moment, words = TeamMoment.of(executive, self._possible), self._words.newest_first
        self.server.show(lambda: moment.shown(self._rate, words))
