"""`robust pike new`: plans with choices to begin with, as files."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

from robust.cli.build import action
from robust.cli.guard import Run
from robust.errors import InputError, Location
from robust.numbers import shorten
from robust.options.declare import option, place_of, refuse_replacing
from robust.options.shared import Force, Output

if TYPE_CHECKING:
    from robust.pike_bridge.action_model import Instance

KINDS = ("kitchen", "wing", "k-intents", "random", "figure")
_ONLY = {"structure": ("k-intents",), "seed": ("k-intents", "random"), "index": ("random",), "sizes": ("random",),
         "number": ("figure",)}  # fmt: skip


def _structure(text: str, place: Location) -> tuple[int, ...]:
    """`2,3,2`: how many options each pair of choices has."""
    try:
        found = tuple(int(part) for part in text.split(","))
    except ValueError:
        found = ()
    if not found or min(found) < 1 or max(found) > 1000 or len(found) > 100:
        raise InputError(f"found {shorten(text)}, expected whole numbers of at least 1 such as 2,3,2", place)
    return found


class PikeNewCommand(Force, Output):
    """Of `robust pike new`."""

    kind: str = option(..., "kitchen, wing, k-intents, random or figure", metavar="KIND", choices=KINDS, argument=True)
    output: Path = option(..., "the directory to write to", "--output", "-o", metavar="DIR", path=True)
    name: str = option("", "of the .tpnu.json file, else that of the plan", metavar="NAME")
    structure: tuple[int, ...] = option(
        "2,2", "k-intents: how many options each pair of choices has", metavar="N,N", read=_structure
    )
    seed: int = option(0, "k-intents, random: decides what is drawn", metavar="N")
    index: int = option(0, "random: the number of the plan among those of the seed", metavar="N")
    sizes: str = option("paper", "random: how large plans are", choices=("small", "medium", "paper"))
    number: str = option(
        "6b", "figure: its number in the paper", choices=("6a", "6b", "7a", "7b", "8", "9", "11", "13", "23")
    )

    def check_combinations(self, given: Collection[str]) -> None:
        for name, kinds in _ONLY.items():
            if name in given and self.kind not in kinds:
                raise InputError(f"expected only with {' and '.join(kinds)}, found {self.kind}", place_of(name))
        if self.index < 0:
            raise InputError(f"found {self.index}, expected a whole number of at least 0", place_of("index"))
        if "/" in self.name or self.name.startswith("."):
            raise InputError(f"found {shorten(self.name)}, expected a name without directory", place_of("name"))


def _makers(options: PikeNewCommand) -> dict[str, Callable[[], Instance]]:
    """What makes a plan of each kind."""
    from robust.pike_bridge.cross_random import SHAPES
    from robust.pike_bridge.figures import FIGURES, shipped
    from robust.pike_bridge.k_intents import k_intents
    from robust.pike_bridge.random_plans import random_plan

    return {
        "kitchen": lambda: shipped("kitchen"),
        "wing": lambda: shipped("wing"),
        "k-intents": lambda: k_intents(options.structure, options.seed).instance,
        "random": lambda: random_plan(options.seed, options.index, SHAPES[options.sizes]),
        "figure": FIGURES[options.number],
    }


@action(PikeNewCommand)
def new(options: PikeNewCommand, run: Run) -> int:
    """Write a plan with choices, with its PDDL, to begin with; what to type next is said."""
    from robust.show import pike_plans as show

    def write() -> tuple[Instance, Path]:
        instance = _makers(options)[options.kind]()
        name = options.name or instance.name
        files = [options.output / each for each in (f"{name}.tpnu.json", "domain.pddl", "problem.pddl")]
        refuse_replacing(files, place_of("output"), force=options.force)
        return instance, instance.write(options.output, name)

    instance, path = run.only(write)
    run.answer(
        lambda: show.new_document(instance, path), lambda out: show.print_new(out, instance, path, quiet=options.quiet)
    )
    return 0
