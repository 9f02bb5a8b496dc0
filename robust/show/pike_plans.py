"""Plans with choices that are made for people: new ones as files, and random ones on which back ends are compared."""

from __future__ import annotations

import shlex
from pathlib import Path

from rich.console import Console
from rich.text import Text

from robust.codec import Count, JsonObject, like
from robust.numbers import plural
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.cross_random import RandomCrossed
from robust.show.documents import Document, Ended, document
from robust.show.pike import Disagreement


class PikeNew(JsonObject, tag_field="schema", tag="robust/pike-new/1"):
    """what `robust pike new --json` prints

    Attributes:
        name: of the plan
        files: that were written, the plan first
    """

    name: str
    files: list[str]
    choices: Count
    events: Count
    activities: Count


class RandomDisagreement(Disagreement):
    """
    Attributes:
        plan: the number of the plan among those of the seed
    """

    plan: Count


class PikeCrossRandom(JsonObject, tag_field="schema", tag="robust/pike-cross-random/1"):
    """what `robust pike check --cross --random --json` prints

    Attributes:
        plans: that were compared, of those wanted
        feasible: plans that admit a correct execution
        scenarios: of all plans, that admit one
        questions: asked of each back end
        out_of_time: by back end, on how many plans it did not finish
        witness: the file of a small plan that shows the first disagreement
    """

    status: Ended
    agree: bool
    seed: int
    sizes: str
    wanted: Count
    plans: Count
    feasible: Count
    scenarios: Count
    questions: dict[str, Count]
    out_of_time: dict[str, Count]
    disagreements: list[RandomDisagreement]
    witness: str | None


DOCUMENTS: tuple[type[JsonObject], ...] = (PikeNew, PikeCrossRandom)
"""As in :mod:`robust.show.documents`."""


def _line(out: Console, text: str) -> None:
    out.print(Text(text), soft_wrap=True)


# -- new plans ---------------------------------------------------------------------------------------------------------


def new_document(instance: Instance, path: Path) -> Document:
    """`robust/pike-new/1`."""
    network = instance.network
    return document(
        PikeNew(
            name=instance.name,
            files=[str(path), *(str(path.with_name(each)) for each in ("domain.pddl", "problem.pddl"))],
            choices=len(network.choices),
            events=len(network.events),
            activities=len(network.activities),
        )
    )


def print_new(out: Console, instance: Instance, path: Path, *, quiet: bool) -> None:
    """What was written; unless `quiet` also what to type next."""
    network = instance.network
    _line(out, f"{path}: {plural(len(network.choices), 'choice')}, {plural(len(network.activities), 'activity')}"
               .replace("activitys", "activities") + "; beside it domain.pddl and problem.pddl")  # fmt: skip
    if quiet:
        return
    file = shlex.quote(str(path))
    parameter = shlex.quote(f"duration:{network.activities[0].action}") if network.activities else "SPEC"
    for text in (
        f"check {file} --all-scenarios",
        f"run {file} --explain",
        f"region {file} --parameter {parameter}",
        f"plot {file} -o {shlex.quote(str(path.with_name('plan.svg')))}",
    ):
        _line(out, f"  robust pike {text}")


# -- back ends on random plans -----------------------------------------------------------------------------------------


def random_cross_document(crossed: RandomCrossed) -> Document:
    """`robust/pike-cross-random/1`."""
    return document(
        like(
            PikeCrossRandom,
            crossed,
            questions=dict(crossed.questions),
            out_of_time=dict(crossed.out_of_time),
            disagreements=[like(RandomDisagreement, one, plan=index) for index, one in crossed.disagreements],
            witness=None if crossed.written is None else str(crossed.written),
        )
    )


def print_random_cross(out: Console, crossed: RandomCrossed, *, quiet: bool) -> None:
    """Whether all agree, or the smallest disagreement and how to see it again; unless `quiet` also who was asked."""
    seed, sizes = crossed.seed, crossed.sizes
    found = (
        f"{plural(crossed.plans, f'{sizes} random plan')} of seed {seed}, {crossed.feasible} with a correct execution"
    )
    if crossed.agree:
        asked = sum(crossed.questions.values())
        _line(out, f"All agree on {found}: {plural(crossed.scenarios, 'team scenario')}, {plural(asked, 'question')}.")
    if crossed.smallest is not None:
        index, smallest = crossed.smallest
        _line(out, f"{plural(len(crossed.disagreements), 'disagreement')} with the oracle on {found}, the smallest:")
        _line(out, f"  plan {index}: {smallest}")
        again = f"robust pike new random --seed {seed} --index {index} --sizes {sizes} -o DIR"
        _line(out, f"  {again} writes the plan")
    if not quiet:
        for name, count in crossed.questions.items():
            late = crossed.out_of_time[name]
            tail = f", out of time on {plural(late, 'plan')}" if late else ""
            _line(out, f"  {name}: {plural(count, 'question')}{tail}")
    if crossed.written is not None:
        _line(out, f"The smallest plan found that shows it: {crossed.written}")
    if crossed.cut_short:
        why = "Out of time" if crossed.status == "timeout" else "Interrupted"
        _line(out, f"{why} after {crossed.plans} of {crossed.wanted} plans.")
