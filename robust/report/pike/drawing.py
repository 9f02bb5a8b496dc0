"""`robust pike plot`: a drawing of a plan with choices."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from robust.report import options
from robust.report.guard import Guard
from robust.report.output import answering, print_json
from robust.report.pike.requests import assumptions, guarded
from robust.report.progress import Display
from robust.report.terminal import console

SCHEMA = "robust/pike-plot/1"


@dataclass(frozen=True)
class PikePlotRequest:
    """The options as they were typed."""

    file: Path
    output: Path
    assume: tuple[str, ...] = ()
    links: bool = False
    epsilon: str = "1/1000"
    json: bool = False
    quiet: bool = False
    progress: bool = False


@dataclass(frozen=True)
class Drawn:
    """What was drawn, after restriction to the assumptions."""

    output: Path
    events: int
    activities: int
    choices: int
    links: int | None


def run_pike_plot(request: PikePlotRequest, guard: Guard) -> int:
    """Draw, and say what.

    Raises:
        RobustError: wrong input, or input that is not supported.
        GivenUpError: if interrupted.
    """
    output = options.plot_file(request.output)
    epsilon = options.positive(request.epsilon, "--epsilon")
    with Display(shown=request.progress, what="reading") as display:
        drawn = guarded(
            guard,
            None,
            display,
            lambda: _draw(request, output or request.output, epsilon, display),
            lambda: None,
            lambda _: None,
        )
    if request.json:
        print_json(plot_answer(drawn))
    elif not request.quiet:
        with answering():
            console().print(
                f"{drawn.output}: {drawn.events} events, {drawn.activities} activities, {drawn.choices} choices"
                + ("" if drawn.links is None else f", {drawn.links} labeled causal links")
            )
    return 0


def plot_answer(drawn: Drawn) -> dict[str, object]:
    """`robust/pike-plot/1`."""
    return {
        "schema": SCHEMA,
        "plot": str(drawn.output),
        "events": drawn.events,
        "activities": drawn.activities,
        "choices": drawn.choices,
        "links": drawn.links,
    }


def _draw(request: PikePlotRequest, output: Path, epsilon: Fraction, display: Display) -> Drawn:
    from robust.pike_bridge.action_model import load_team_plan  # noqa: PLC0415 - imports the grammar
    from robust.pike_bridge.compile import checked_assumptions  # noqa: PLC0415 - imports solvers
    from robust.pike_bridge.scenarios import restrict  # noqa: PLC0415

    plan = load_team_plan(request.file, epsilon=epsilon)
    plan = restrict(plan, checked_assumptions(plan, assumptions(request.assume)))
    links = None
    if request.links:
        from robust.pike_bridge.causal import augment  # noqa: PLC0415
        from robust.pike_bridge.temporal.structural import structural_precedence  # noqa: PLC0415

        display.say("links")
        links = augment(plan, structural_precedence(plan.network)).links
    display.say("drawing")
    from robust.pike_bridge.plot import Link, plot_network  # noqa: PLC0415 - imports matplotlib

    arrows = [Link(link.producer.event, link.consumer.first, str(link.consumer.literal)) for link in links or ()]
    plot_network(plan.network, output, links=arrows, epsilon=epsilon)
    network = plan.network
    return Drawn(
        output,
        len(network.events),
        len(network.activities),
        len(network.choices),
        None if links is None else len(links),
    )
