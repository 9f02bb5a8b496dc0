"""What an executive is told, and what it announces: its streams [PIKE §2.2 and Algorithm 1]."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TypeAlias

from robust.pike_bridge.model import Assignment
from robust.plan.model import Atom


@dataclass(frozen=True, slots=True)
class Outcome:
    """A human or nature has decided an uncontrollable choice: U(t)."""

    choice: str
    value: str

    def __str__(self) -> str:
        return f"{self.choice} = {self.value}"


@dataclass(frozen=True, slots=True)
class Completion:
    """A dispatched activity has ended: A(t). `event`, its end, is needed only if several of the same action run."""

    action: str
    event: str | None = None

    def __str__(self) -> str:
        return f"{self.action} has ended{f' at {self.event}' if self.event else ''}"


@dataclass(frozen=True, slots=True)
class Estimate:
    """What is seen of the state now: P(t). If `complete`, every atom that is not said to be true is false."""

    true: frozenset[Atom] = frozenset()
    false: frozenset[Atom] = frozenset()
    complete: bool = False

    def __str__(self) -> str:
        literals = [*sorted(map(str, self.true)), *(f"(not {atom})" for atom in sorted(map(str, self.false)))]
        return f"seen: {', '.join(literals) or 'nothing'}{', all else is false' if self.complete else ''}"


Message: TypeAlias = Outcome | Completion | Estimate


@dataclass(frozen=True, slots=True)
class Executed:
    """An event has its time; `reported` says that the world decided it, by ending an activity."""

    event: str
    time: Fraction
    reported: bool = False


@dataclass(frozen=True, slots=True)
class Dispatched:
    """An activity begins now: its agent is to do it."""

    action: str
    agent: str | None
    time: Fraction
    end: str
    """The event at which it ends."""
    lower: Fraction
    upper: Fraction | None


@dataclass(frozen=True, slots=True)
class Chosen:
    """A choice has its value; `observed` says that it was not ours to make."""

    choice: str
    value: str
    time: Fraction
    observed: bool = False


@dataclass(frozen=True, slots=True)
class Violated:
    """Something that later activities rely on is not so any more: causal links are broken.

    It need not be the end: other support may be left.
    """

    atom: Atom
    expected: bool
    """What the atom was supposed to be."""
    producer: str
    """The event that had made it so."""
    consumers: tuple[str, ...]
    """Who relied on it, actions or `the goal`."""
    time: Fraction


@dataclass(frozen=True, slots=True)
class Rejected:
    """A message that changes nothing, and why."""

    message: str
    reason: str
    time: Fraction


@dataclass(frozen=True, slots=True)
class Failed:
    """No correct execution is left: from now on nothing is dispatched."""

    time: Fraction
    reason: str


@dataclass(frozen=True, slots=True)
class Succeeded:
    """Every activated event has been executed, correctly."""

    time: Fraction
    scenario: tuple[Assignment, ...] = field(default=())
    """What was chosen, by whomever."""


Decision: TypeAlias = Executed | Dispatched | Chosen | Violated | Rejected | Failed | Succeeded
