"""What the comparisons run: ways to an envelope, as the verb and the options of the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..engine.measure import Files, Run, run_robust
from ..engine.show import NOTHING, number
from ..suite import RecordedRun

BACKENDS = ("project", "z3", "cvc5", "fourier-motzkin", "loos-weispfenning")
"""The elimination back ends that are compared; each has another idea behind it."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A way to an envelope."""

    name: str
    label: str
    verb: str
    options: tuple[str, ...]

    def run(self, files: Files, *, limit: float | None = None, extra: Sequence[str] = ()) -> Run:
        """Run the command on the files as a process of its own."""
        return run_robust(self.verb, files, [*self.options, *extra], limit=limit)


IRR = Contender("irr", "IRR", "envelope", ("--method", "irr", "--beta", "1", "--doubling"))
WIDEN = Contender("widen", "exact widening", "envelope", ("--method", "widen"))
OPTIMAL = Contender("optimal", "optimal box", "envelope", ("--method", "optimal"))
RECORDED_BOX = Contender("recorded-box", "recorded IRR box, checked", "check", ())
"""Not a way to an envelope: a proof that the recorded box is inside it, which needs no region."""
REGIONS = tuple(
    Contender(name, f"region, {name}", "region", ("--backend", name, "--form", "difference")) for name in BACKENDS
)
"""The form is the one in which the region is computed: turning it into another would be measured as well."""
OURS = (IRR, WIDEN)
BASELINE = (OPTIMAL, *REGIONS)
"""What CCMMZ computed: exact regions, by several back ends, and the widest box."""
BY_NAME = {one.name: one for one in (*OURS, *BASELINE, RECORDED_BOX)}


def run_cell(run: Run | None) -> str:
    """Seconds of a complete run, else how it ended."""
    if run is None:
        return NOTHING
    return number(run.seconds) if run.complete else run.status.value.replace("timeout", "out of time")


def recorded_cell(run: RecordedRun | None) -> str:
    if run is None:
        return NOTHING
    return number(run.wall_s) if run.solved else run.status
