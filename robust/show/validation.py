"""Verdicts about single schedules, for people and as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta
from rich.text import Text

from robust.errors import UNSUPPORTED
from robust.json_text import Count, JsonObject, Rational, like, one_of
from robust.numbers import format_number, plural
from robust.show.console import colour_of
from robust.show.documents import Document, Ended, Noted, document

if TYPE_CHECKING:
    from rich.console import Console

    from robust.errors import RobustError
    from robust.execute.validate import Verdict


@dataclass(frozen=True, slots=True)
class Judged:
    """One plan, as its files are called, and the verdict about it, or why there is none."""

    domain: Path
    problem: Path
    plan: Path
    verdict: Verdict | None = None
    error: RobustError | None = None

    @property
    def exit_code(self) -> int:
        if self.error is not None:
            return self.error.exit_code
        return 0 if self.verdict is not None and self.verdict.valid else 1

    @property
    def word(self) -> str:
        """The verdict in one word."""
        if self.error is not None:
            return "unsupported" if self.error.exit_code == UNSUPPORTED else "error"
        return "valid" if self.exit_code == 0 else "invalid"


_WORDS = ("valid", "invalid", "error", "unsupported")


# -- for people --------------------------------------------------------------------------------------------------------


def print_verdicts(out: Console, judged: Sequence[Judged], *, quiet: bool) -> None:
    """A line for each plan; unless `quiet` also what it breaks and what would help. More than one are counted."""
    for one in judged:
        named = len(judged) == 1 or str(one.error).startswith(str(one.plan))
        text = Text("" if named else f"{one.plan}: ")
        text.append(one.word, style=colour_of(one.word))
        text.append(f": {one.verdict.size if one.verdict is not None else one.error}")
        out.print(text, soft_wrap=True)
        if one.verdict is not None and not quiet:
            for breach in one.verdict.violations:
                out.print(Text(f"  {breach}"), soft_wrap=True)
            for name, value in one.verdict.remedies.named.items():
                out.print(Text(f"  --{name} {format_number(value)} would make it valid", style="dim"), soft_wrap=True)
    if len(judged) > 1:
        counts = Counter(sorted((one.word for one in judged), key=_WORDS.index))
        parts = [plural(counts[word], word) if word == "error" else f"{counts[word]} {word}" for word in counts]
        out.print(Text(", ".join(parts), style="dim"))


# -- JSON --------------------------------------------------------------------------------------------------------------


class BrokenDemand(JsonObject):
    """
    Attributes:
        obligation: named as by robust check; steps are n0, n1, ... in the order of the plan
        demand: the obligation in words
        detail: what is so instead
        amount: how far a number is from what is demanded; null where no single number decides
        lines: where the steps that it is about stand in the plan
    """

    time: Rational
    obligation: str
    demand: str
    detail: str
    amount: Rational | None
    lines: list[Annotated[int, Meta(ge=1)]]


class Shift(JsonObject):
    """how exact times differ from the printed ones

    Attributes:
        durations: how many durations differ
        starts: how many starts differ
        most: how far one of them was moved at most
    """

    durations: Count
    starts: Count
    most: Rational


class Helps(JsonObject):
    """what would make the plan valid, each by itself; null where the printed order leaves nothing of its
    kind

    Attributes:
        tolerance: with --tolerance at this number
        epsilon: the greatest --epsilon of three digits
    """

    tolerance: Rational | None
    epsilon: Rational | None


class JudgedPlan(JsonObject):
    """
    Attributes:
        verdict: error: what cannot be read, or does not fit together; unsupported: what cannot be decided
        steps: how many the plan has; null without a verdict
        end: when the last step ends; null without a verdict
        shift: null where no time had to move, or no exact schedule is near enough
        violations: by time; of a schedule without an exact one near enough, without separations that rounding explains
        error: null with a verdict
    """

    domain: str
    problem: str
    plan: str
    verdict: Annotated[str, one_of(*_WORDS)]
    steps: Count | None
    end: Rational | None
    shift: Shift | None
    violations: list[BrokenDemand]
    remedies: Helps
    error: str | None


class Validate(Noted, tag_field="schema", tag="robust/validate/1"):
    """robust validate --json: verdicts about single schedules, as VAL judges them

    Attributes:
        status: interrupted: the plans that were judged by then
        tolerance: null: what printed digits say
    """

    status: Ended
    epsilon: Rational
    tolerance: Rational | None
    valid: Count
    plans: list[JudgedPlan]


def one(verdict: Verdict) -> Document:
    """Of a single plan."""
    return validate([_alone(verdict)], "complete", verdict.epsilon, verdict.tolerance)


def print_one(out: Console, verdict: Verdict, *, quiet: bool) -> None:
    """The verdict about a single plan."""
    print_verdicts(out, [_alone(verdict)], quiet=quiet)


def _alone(verdict: Verdict) -> Judged:
    """What is known of a plan whose files only a command knows."""
    return Judged(Path(), Path(), Path(verdict.plan), verdict)


def validate(judged: Sequence[Judged], status: str, epsilon: Fraction, tolerance: Fraction | None) -> Document:
    return document(
        Validate(
            status=status,
            epsilon=epsilon,
            tolerance=tolerance,
            valid=sum(one.word == "valid" for one in judged),
            plans=[_judged(one) for one in judged],
        )
    )


def _judged(one: Judged) -> JudgedPlan:
    found, files = one.verdict, {name: str(getattr(one, name)) for name in ("domain", "problem", "plan")}
    if found is None:
        return JudgedPlan(
            **files,
            verdict=one.word,
            steps=None,
            end=None,
            shift=None,
            violations=[],
            remedies=Helps(tolerance=None, epsilon=None),
            error=str(one.error),
        )
    return JudgedPlan(
        **files,
        verdict=one.word,
        steps=found.steps,
        end=found.end,
        shift=None if found.snapped is None else like(Shift, found.snapped, most=found.snapped.shift),
        violations=[like(BrokenDemand, breach, lines=list(breach.lines)) for breach in found.violations],
        remedies=like(Helps, found.remedies),
        error=None,
    )


DOCUMENTS: tuple[type[JsonObject], ...] = (Validate,)
"""As in :mod:`robust.show.documents`."""
