"""What an encoding is to those who ask: named obligations with queries, and a decision of enc_valid [IRR §2, §4].

Two encodings implement it: `relational` and `positions` [docs/semantics.md]. They share this page, the unknowns of
:mod:`robust.encode.variables` and the plan model, and otherwise no code, so that each is a check of the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import Protocol

from robust.encode.variables import Linear, Range, least
from robust.plan.model import ParametrizedPlan, TimePoint
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms

EPSILON = Fraction(1, 1000)
ENCODINGS = ("relational", "positions")


class Stage(Enum):
    """The order in which obligations are examined; a stage assumes the earlier ones."""

    DURATION = 0
    SEPARATION = 1
    CONDITION = 2


@dataclass(frozen=True)
class Obligation:
    """One conjunct of enc_proofs, named after its source; `violation` is its negation over the encoding's unknowns."""

    name: str
    stage: Stage
    violation: Formula


@dataclass(frozen=True, slots=True)
class Facet:
    """`expression ≥ 0` over parameters, necessary for membership in the envelope.

    `origins` are the statements that it is the sum of; `obligation` is set if it is not about existence of a schedule
    but is that obligation itself.
    """

    expression: Linear
    origins: tuple[str, ...]
    obligation: str | None = None

    def breaks_in(self, ranges: Mapping[str, Range]) -> bool:
        """Whether some point of a box lies outside the facet."""
        floor = least(self.expression, ranges)
        return floor is None or floor < 0


class Existence(Protocol):
    """enc_valid: for which parameter values some schedule exists."""

    def broken_facet(
        self, ranges: Mapping[str, Range], make_session: Callable[[], Session], deadline: Deadline
    ) -> Facet | Verdict | None:
        """A facet that some point of the box breaks; None if every point has a schedule; UNKNOWN out of time."""

    def contradiction(self, values: Mapping[str, Fraction]) -> Facet | None:
        """Statements of the network that cannot hold together at one point; None if it has a schedule there."""


class Encoding(Protocol):
    """enc_tn, enc_eff and enc_proofs of one plan, in formulas over `terms`.

    Parameters are the symbols of their references; formulas of one encoding belong to its own `terms`. Encodings may
    build formulas only when a query needs them: those raise OutOfTimeError then if the encoding's deadline passes.
    """

    @property
    def name(self) -> str:
        """Which of `ENCODINGS` it is."""

    @property
    def plan(self) -> ParametrizedPlan: ...

    @property
    def epsilon(self) -> Fraction: ...

    @property
    def terms(self) -> Terms: ...

    @property
    def validity(self) -> Existence: ...

    @property
    def obligations(self) -> tuple[Obligation, ...]:
        """Every obligation, stage by stage."""

    def query(self, obligation: Obligation) -> list[Formula]:
        """Satisfiable, for parameter values within enc_valid, if some schedule breaks the obligation."""

    def full_query(self, obligation: Obligation) -> list[Formula]:
        """As :meth:`query` over the whole network: a model gives a time to every time point."""

    def network_formulas(self) -> list[Formula]:
        """enc_tn."""

    def parameters_in(self, formulas: Iterable[Formula]) -> frozenset[str]:
        """Names of the parameters that occur in formulas."""

    def unknowns(self) -> list[Formula]:
        """The symbols whose values determine parameters and schedule."""

    def schedule(self, values: Mapping[str, Fraction]) -> dict[TimePoint, Fraction]:
        """The time of every time point, from values of :meth:`unknowns` by symbol name."""
