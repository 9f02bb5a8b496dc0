"""`robust demo`: what a user would type, on examples that come with the program, and what comes out."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.text import Text

from robust.report.checking import CheckRequest, run_check
from robust.report.enveloping import EnvelopeRequest, run_envelope
from robust.report.guard import UNDECIDED, Guard
from robust.report.output import answering
from robust.report.terminal import console

EXAMPLES = Path(__file__).parents[1] / "examples"


@dataclass(frozen=True)
class _Step:
    """One command of the tour: an example, a plan of it, and what to look at."""

    text: str
    command: str
    plan: str
    options: tuple[tuple[str, str], ...] = ()

    @property
    def line(self) -> str:
        """What to type in the directory of the example."""
        options = (word for option in self.options for word in option)
        return shlex.join(["robust", self.command, "domain.pddl", "problem.pddl", self.plan, *options])

    @property
    def files(self) -> tuple[Path, Path, Path]:
        return Path("domain.pddl"), Path("problem.pddl"), Path(self.plan)

    def run(self, guard: Guard) -> int:
        options = dict(self.options)
        if self.command == "check":
            return run_check(CheckRequest(self.files), guard)
        return run_envelope(EnvelopeRequest(self.files, method=options.get("--method", "widen")), guard)


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


def run_demo(guard: Guard) -> int:
    """Take the tour; returns 0 unless it was interrupted."""
    with answering():
        return _take_tour(console(), guard)


def _take_tour(out: Console, guard: Guard) -> int:
    for name, text, steps in _TOUR:
        directory = EXAMPLES / name
        out.print(Text(text, style="bold"), soft_wrap=True)
        _show_command(out, f"cd {shlex.quote(str(directory))}")
        with _inside(directory):
            for step in steps:
                out.print()
                out.print(Text(step.text), soft_wrap=True)
                _show_command(out, step.line)
                if step.run(guard) == UNDECIDED:
                    return UNDECIDED
        out.print()
    out.print(Text("Where to go next", style="bold"))
    for command, what in _NEXT:
        out.print(Text.assemble("  ", (f"{command:<36}", "cyan"), what), soft_wrap=True)
    return 0


_NEXT = (
    ("robust check --help", "values and ranges of parameters, all obligations, JSON, SMT-LIB"),
    ("robust envelope --help", "methods, other quantities as parameters, plots, time limits"),
    ("robust envelope ... --plot box.svg", "draw the box and how the search came to it"),
    ("robust region --help", "all valid parameter values, exactly"),
    ("robust compare --help", "the exact region beside the boxes of all methods"),
)


def _show_command(out: Console, line: str) -> None:
    out.print(Text.assemble(("$ ", "dim"), (line, "cyan")), soft_wrap=True)


@contextmanager
def _inside(directory: Path) -> Iterator[None]:
    """So that commands can be shown as short as they would be typed."""
    before = Path.cwd()
    os.chdir(directory)
    try:
        yield
    finally:
        os.chdir(before)
