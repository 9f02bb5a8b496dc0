"""Verdicts about single schedules, for people and as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from msgspec import field

from robust.errors import UNSUPPORTED
from robust.execute.validate import Breach, Remedies, Verdict
from robust.json_text import Count, JsonObject, Rational, like, on_wire, one_of
from robust.numbers import format_number, plural
from robust.show.console import Console, Text, colour_of, printing
from robust.show.documents import Document, Ended, Noted, document, documenting, has_table

if TYPE_CHECKING:
    from robust.errors import RobustError
    from robust.execute.snap import Snapped


@dataclass(frozen=True, slots=True)
class JudgedPlan:
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


def print_verdicts(out: Console, judged: Sequence[JudgedPlan], *, quiet: bool) -> None:
    """A line for each plan; unless `quiet` also what it breaks and what would help. More than one are counted."""
    for plan in judged:
        named = len(judged) == 1 or str(plan.error).startswith(str(plan.plan))
        text = Text("" if named else f"{plan.plan}: ")
        text.append(plan.word, style=colour_of(plan.word))
        text.append(f": {plan.verdict.size if plan.verdict is not None else plan.error}")
        out.line(text)
        if plan.verdict is not None and not quiet:
            for breach in plan.verdict.violations:
                out.line(f"  {breach}")
            for name, value in plan.verdict.remedies.named.items():
                out.line(f"  --{name} {format_number(value)} would make it valid", "dim")
    if len(judged) > 1:
        counts = Counter(sorted((plan.word for plan in judged), key=_WORDS.index))
        parts = [plural(counts[word], word) if word == "error" else f"{counts[word]} {word}" for word in counts]
        out.print(Text(", ".join(parts), style="dim"))


# -- JSON --------------------------------------------------------------------------------------------------------------


on_wire("Snapped", times=None, shift="most")


class JudgedPlanRecord(JsonObject, kw_only=True):
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
    steps: Count | None = None
    end: Rational | None = None
    shift: Snapped | None
    violations: list[Breach] = field(default_factory=list)
    remedies: Remedies = Remedies()
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
    plans: list[JudgedPlanRecord]


@documenting.register(Verdict)
def _(verdict: Verdict) -> Document:
    return validate([_alone(verdict)], "complete", verdict.epsilon, verdict.tolerance)


has_table(Verdict, "plans", 0, "violations", numbers=("time", "amount"))


@printing.register(Verdict)
def _(out: Console, verdict: Verdict, *, quiet: bool) -> None:
    print_verdicts(out, [_alone(verdict)], quiet=quiet)


def _alone(verdict: Verdict) -> JudgedPlan:
    """A verdict about a plan whose files only a command knows."""
    return JudgedPlan(Path(), Path(), Path(verdict.plan), verdict)


def validate(judged: Sequence[JudgedPlan], status: str, epsilon: Fraction, tolerance: Fraction | None) -> Document:
    """The document that `robust validate --json` prints."""
    return document(
        Validate(
            status=status,
            epsilon=epsilon,
            tolerance=tolerance,
            valid=sum(plan.word == "valid" for plan in judged),
            plans=[_record(plan) for plan in judged],
        )
    )


def _record(judged: JudgedPlan) -> JudgedPlanRecord:
    return like(
        JudgedPlanRecord,
        judged.verdict,
        domain=str(judged.domain),
        problem=str(judged.problem),
        plan=str(judged.plan),
        verdict=judged.word,
        shift=None if judged.verdict is None else judged.verdict.snapped,
        error=None if judged.verdict is not None else str(judged.error),
    )
