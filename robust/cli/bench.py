"""`robust bench NAME`: the experiments of the package `benchmarks`, or `robust_benchmarks` where it is installed."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robust.cli.build import Action, Command
from robust.cli.guard import Run
from robust.errors import UNDECIDED

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True, slots=True)
class ExperimentCommand(Command):
    """The command of one experiment, which is loaded when it is run."""

    entry: Any

    def load(self) -> Action[Any]:
        def carry_out(options: Any, run: Run) -> int:
            return _carry_out(self.entry, options, run)

        carry_out.__doc__ = self.entry.help
        return Action(self.entry.options, carry_out, None)


def _carry_out(entry: Any, options: Any, run: Run) -> int:
    with run.guard.working():
        experiment = entry.load()
    run.display.say("running")
    with run.guard.handed_over():
        report = experiment.run(options, on_result=run.display.batch)

    def tell(out: Console) -> None:
        for table in report.tables:
            out.print(table.rich(), markup=True)

    run.answer(report.as_dict, tell)
    run.write(report.plot)
    if not report.complete:
        return UNDECIDED
    return 0 if report.agrees else 1


def _catalogue() -> Mapping[str, Any]:
    """The experiments beside this package, or else those that are installed with it."""
    root = Path(__file__).parents[2]
    if not (root / "benchmarks" / "catalogue.py").is_file():
        name = "robust_benchmarks"
    else:
        name = "benchmarks"
        if name not in sys.modules:
            sys.path.insert(0, str(root))  # before any other package of that name
    found: Mapping[str, Any] = import_module(f"{name}.catalogue").EXPERIMENTS
    return found


EXPERIMENTS = {name: ExperimentCommand(entry.summary, "", entry) for name, entry in _catalogue().items()}
