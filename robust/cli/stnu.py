"""`robust stnu`: networks with uncertainty of other tools, any number of files at a time."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from robust.cli.guard import Cause, GivenUpError, Run, action
from robust.errors import UNDECIDED, InputError, RobustError, did_you_mean, worst
from robust.numbers import plural, shorten
from robust.options import batch, declare
from robust.records import atomic_write
from robust.show import stnu as show
from robust.show.stnu import JudgedNetwork, ended
from robust.smt.limits import Deadline
from robust.stnu import verdicts
from robust.stnu.files import load, read, write
from robust.stnu.network import ConditionalNetwork, Network, with_quantile
from robust.stnu.verdicts import NetworkCheck, NetworkRepair, NetworkRepairSearch, NetworkVerdict

if TYPE_CHECKING:
    from robust.searching import AnytimeSearch

Asked = TypeVar("Asked", "Network", "Network | ConditionalNetwork")
Result = TypeVar("Result")


@action(batch.StnuCheckCommand)
def check(options: batch.StnuCheckCommand, run: Run) -> int:
    """Can a dispatcher that sees contingent links end satisfy all requirements, whatever nature does? If not, why?"""

    def judge(network: Network | ConditionalNetwork) -> NetworkCheck:
        if not isinstance(network, Network):
            return run.only(lambda: _conditional(network, run))
        return run.only(lambda: verdicts.check(network, timeout=run.remaining))

    judged, cause = _each(options, run, read, judge)
    run.answer(
        lambda: show.check_document(judged, _status(judged, cause)),
        lambda out: show.print_checks(out, judged, quiet=options.quiet),
    )
    return _code(judged, cause)


def _conditional(network: ConditionalNetwork, run: Run) -> NetworkCheck:
    """The verdict about a plan with choices."""
    from robust.pike_bridge.conditional import plan_of_network
    from robust.pike_bridge.game.controllability import DecidingControllability
    from robust.show.pike_games import headline

    found = DecidingControllability(plan_of_network(network), deadline=Deadline.after(run.remaining)).run()
    verdict = NetworkVerdict(found.verdict.value)
    first, *others = headline(found)
    words = f"{first.removeprefix('Not controllable: ')} {'; '.join(map(str.strip, others))}".strip()
    reason = None if verdict is NetworkVerdict.CONTROLLABLE else words
    return NetworkCheck(network, verdict, (), reason, found.seconds)


@action(batch.StnuRiskCommand)
def risk(options: batch.StnuRiskCommand, run: Run) -> int:
    """How likely can all requirements be met if the lengths of contingent links are random?"""
    from robust.stnu.chances import open_links, searching_risk
    from robust.stnu.files import load

    network = run.only(lambda: load(options.file))
    if unknown := open_links(network):
        links = ", ".join(map(str, unknown))
        run.note(f"found no distribution of {links}: success is that a schedule exists whatever these lengths are")
    within, follow = options.within, run.display.bounds
    result = run.reply(lambda: searching_risk(network, within=within, timeout=run.remaining, on_bounds=follow))
    return UNDECIDED if result.cut_short else 0


@action(batch.StnuDispatchCommand)
def dispatch(options: batch.StnuDispatchCommand, run: Run) -> int:
    """How is a network executed? The minimal dispatchable network, its waits, and simulated executions."""

    def judge(network: Network) -> show.SimulatedDispatch:
        def work() -> show.SimulatedDispatch:
            result = verdicts.dispatch(network, timeout=run.remaining)
            runs = range(options.runs if result.tables is not None else 0)
            return show.SimulatedDispatch(result, tuple(result.execute(options.seed + number) for number in runs))

        return run.only(work)

    judged, cause = _each(options, run, load, judge)
    run.answer(
        lambda: show.dispatch_document(judged, _status(judged, cause)),
        lambda out: show.print_dispatches(out, judged, quiet=options.quiet),
    )
    return _code(judged, cause)


@action(batch.StnuRepairCommand)
def repair(options: batch.StnuRepairCommand, run: Run) -> int:
    """What is the least change of bounds after which a network is controllable? Ctrl-C prints the best so far."""

    def judge(network: Network) -> NetworkRepair:
        def begin() -> AnytimeSearch[NetworkRepair]:
            return NetworkRepairSearch(network, *_weights(options, network), Deadline.after(run.remaining))

        return run.best(begin, lambda last: tell([*judged, JudgedNetwork(Path(network.name), last)]))

    def tell(networks: list[JudgedNetwork[NetworkRepair]]) -> None:
        run.answer(
            lambda: show.repair_document(networks, _status(networks, cause), written),
            lambda out: show.print_repairs(out, networks, written, quiet=options.quiet),
        )

    judged: list[JudgedNetwork[NetworkRepair]] = []
    written: str | None = None
    cause: Cause | None = None
    _, cause = _each(options, run, load, judge, judged)
    if options.output is not None and (last := judged[-1].result) is not None and last.network is not None:
        from robust.stnu.graphml import scaled

        content, scale = write(last.network, options.output)
        run.write(partial(atomic_write, options.output, content, declare.place_of("output")))
        written = str(options.output)
        if scale != 1:
            run.note(scaled(options.output, scale))
    tell(judged)
    return _code(judged, cause)


def _each(
    options: batch.StnuFiles,
    run: Run,
    read: Callable[[Path], Asked],
    judge: Callable[[Asked], Result],
    judged: list[JudgedNetwork[Result]] | None = None,
) -> tuple[list[JudgedNetwork[Result]], Cause | None]:
    """What is found of each file, and why the last ones are missing; one that cannot be read is no obstacle to others.

    Raises:
        RobustError: if the only file cannot be read.
        GivenUpError: if nothing was found.
    """
    quantile = Fraction(options.quantile)
    judged = [] if judged is None else judged
    for number, file in enumerate(options.files, start=1):
        run.display.say(f"network {number} of {len(options.files)}: {file}")
        try:
            network = with_quantile(run.only(partial(read, file)), quantile)
            if quantile == 0 and (
                count := sum(link.distribution is not None and link.lower != link.upper for link in network.contingents)
            ):
                run.note(
                    f"{file}: {plural(count, 'random length')} may be all that is possible; --quantile Q cuts tails"
                )
            judged.append(JudgedNetwork(file, judge(network)))
        except GivenUpError as error:
            if not judged:
                raise
            return judged, run.guard.why(error)
        except RobustError as error:
            if len(options.files) == 1:
                raise
            judged.append(JudgedNetwork(file, None, error))
    return judged, None


def _status(judged: list[JudgedNetwork[Any]], cause: Cause | None) -> str:
    """How it ended."""
    if cause is not None:
        return cause.value
    return ended(judged)


def _code(judged: list[JudgedNetwork[Any]], cause: Cause | None) -> int:
    return worst([*(row.code for row in judged), 0 if cause is None else UNDECIDED])


def _weights(
    options: batch.StnuRepairCommand, network: Network
) -> tuple[Fraction | None, Fraction | None, dict[tuple[str, str], Fraction | None]]:
    """The weights of requirements, of contingent links, and of single links."""
    kinds: dict[str, Fraction | None] = {"requirement": Fraction(1), "contingent": Fraction(1)}
    ends = {f"{link.source}:{link.target}": (link.source, link.target) for link in network.links}
    single = {}
    for name, weight in options.weight:
        if name in ends:
            single[ends[name]] = weight
        elif name in kinds:
            kinds[name] = weight
        else:
            known = (*kinds, *ends)
            raise InputError(
                f"found unknown link {shorten(name)}{did_you_mean(name, known)}", declare.place_of("weight")
            )
    return kinds["requirement"], kinds["contingent"], single
