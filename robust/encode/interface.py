"""What an encoding is to those who ask: named obligations with queries, and a decision of enc_valid [IRR §2, §4].

Two encodings implement it: `relational` and `positions` [docs/semantics.md]. They share what is about times alone
(:mod:`robust.encode.network`) and the list of effects. What holds when, mutex pairs, over-all conditions and the
decision of enc_valid they say without code in common, so that each is a check of the other.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import ClassVar, Protocol

from robust.encode.variables import Grid, IntegerForm, Linear, TimeVariable
from robust.plan.model import ParameterReference, ParametrizedPlan, TimePoint
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms

EPSILON = Fraction(1, 1000)


class Stage(Enum):
    """The order in which obligations are examined; a stage assumes the earlier ones."""

    DURATION = 0
    SEPARATION = 1
    AGREEMENT = 2
    CONDITION = 3


@dataclass(frozen=True)
class Obligation:
    """One conjunct of enc_proofs, named after its source; `violation` is its negation over the encoding's unknowns."""

    name: str
    stage: Stage
    violation: Formula


@dataclass(frozen=True)
class Facet:
    """`expression ≥ 0` over parameters, necessary for membership in the envelope.

    `origins` are the statements that it is the sum of; `obligation` is set if it is not about existence of a schedule
    but is that obligation itself.
    """

    expression: Linear
    origins: tuple[str, ...]
    obligation: str | None = None

    @cached_property
    def form(self) -> IntegerForm:
        """The expression in integers."""
        return IntegerForm(self.expression)

    def breaks_in(self, box: Grid) -> bool:
        """Whether some point of a box lies outside the facet."""
        floor = self.form.least(box)
        return floor is None or floor < 0


class Existence(Protocol):
    """enc_valid: for which parameter values some schedule exists."""

    def broken_facet(
        self, box: Grid, make_session: Callable[[], Session], deadline: Deadline
    ) -> Facet | Verdict | None:
        """A facet that some point of the box breaks; None if every point has a schedule; UNKNOWN out of time."""

    def known_facet(self, box: Grid) -> Facet | None:
        """A facet of the network alone that some point of the box breaks, of those that a search has met."""

    def contradiction(self, values: Mapping[str, Fraction]) -> Facet | None:
        """Statements of the network that cannot hold together at one point; None if it has a schedule there."""


class Encoding(ABC):
    """enc_tn, enc_eff and enc_proofs of one plan, in formulas over `terms`.

    `obligations` are ordered by stage; `places` is every time point's time over the unknowns. Parameters are the
    symbols of their references; formulas of one encoding belong to its own `terms`. Encodings may build formulas only
    when a query needs them: those raise OutOfTimeError then if the encoding's deadline passes.
    """

    name: ClassVar[str]
    """Which of `robust.backends.ENCODINGS` it is."""
    plan: ParametrizedPlan
    epsilon: Fraction
    terms: Terms
    validity: Existence
    obligations: tuple[Obligation, ...]
    places: Mapping[TimePoint, Linear]

    @abstractmethod
    def query(self, obligation: Obligation) -> list[Formula]:
        """Satisfiable, for parameter values within enc_valid, if some schedule breaks the obligation."""

    @abstractmethod
    def full_query(self, obligation: Obligation) -> list[Formula]:
        """As :meth:`query` over the whole network: a model gives a time to every time point."""

    @abstractmethod
    def network_formulas(self) -> list[Formula]:
        """enc_tn over parameters and free time points."""

    def parameters_in(self, formulas: Iterable[Formula]) -> frozenset[str]:
        """Names of the parameters that occur in formulas."""
        symbols = {symbol for formula in formulas for symbol in self.terms.variables(formula)}
        return frozenset(name for name in self.plan.nominal if self.terms.real(ParameterReference(name)) in symbols)

    def unknowns(self) -> list[Formula]:
        """The symbols whose values determine parameters and schedule: of the parameters and the free time points."""
        used = (unknown for place in self.places.values() for unknown in place.variables)
        times = dict.fromkeys(unknown for unknown in used if isinstance(unknown, TimeVariable))
        return [self.terms.real(unknown) for unknown in (*map(ParameterReference, self.plan.nominal), *times)]

    def schedule(self, values: Mapping[str, Fraction]) -> dict[TimePoint, Fraction]:
        """The time of every time point, from values of :meth:`unknowns` by symbol name."""
        return {
            point: place.evaluate({unknown: values[str(unknown)] for unknown in place.variables})
            for point, place in self.places.items()
        }
