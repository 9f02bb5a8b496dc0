"""`robust risk`: how likely a plan succeeds."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from robust.cli.build import action
from robust.cli.plans import load
from robust.options.verbs import RiskCommand

if TYPE_CHECKING:
    from robust.api import Search
    from robust.cli.guard import Run
    from robust.probability.measure import Bounds
    from robust.probability.risk import RiskResult


@action(RiskCommand)
def risk(options: RiskCommand, run: Run) -> int:
    """How likely does the plan succeed if its parameters are random? Ctrl-C prints the bounds so far."""
    from robust.api import searching_risk
    from robust.show.probabilities import bounds_text

    def follow(bounds: Bounds) -> None:
        run.display.say(f"probability of success: {bounds_text(bounds, 4)}")

    def begin() -> Search[RiskResult]:
        plan = load(options, run, nominal_needed=False)
        run.display.say("encoding")
        callbacks = {"on_bounds": follow, "on_stage": run.display.say}
        return searching_risk(plan, options.changed(timeout=run.remaining, **callbacks))

    result = run.reply(begin)
    if options.plot is not None:
        run.write(partial(result.plot, options.plot))
    return 3 if result.cut_short else 0
