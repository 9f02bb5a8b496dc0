"""What a theorem file says: statements, scope, broken variants, and countermodels of what was printed."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from enum import Enum

from proofs.theorems._library.terms import Command, Term


class Scope(Enum):
    """How much of the statement the solvers decide."""

    GENERAL = "general"
    """First-order logic says all of it: any number of events, parameters, values."""
    INDUCTION = "general, by induction"
    """Any number, too; the solvers decide start and step of an induction, whose principle is not theirs to decide."""
    BOUNDED = "bounded"
    """For structures up to a size, which the theorem names."""


class Kind(Enum):
    """What a problem is asked for."""

    CLAIM = "claim"
    """The negated claim under the assumptions: nothing satisfies it."""
    ASSUMPTIONS = "assumptions"
    """The assumptions alone: something satisfies them, so that the claim is not empty."""
    BROKEN = "broken"
    """The negated claim of a variant that we broke: something satisfies it."""
    PRINTED = "printed"
    """The negated claim as a paper printed it: something satisfies it."""


@dataclass(frozen=True, slots=True)
class Result:
    """What a lemma of a theorem proves, for other theorems to assume: the one formula is the claim of that lemma."""

    theorem: str
    lemma: str
    words: str
    formula: Term


@dataclass(frozen=True, slots=True)
class Statement:
    """A claim under assumptions. Declared constants and functions are arbitrary: the claim is for all of them.

    Assumptions are keyed by what they say.
    """

    declarations: tuple[Command, ...]
    assumptions: dict[str, Term]
    claim: Term
    show: dict[str, Term] = field(default_factory=dict)
    """Terms that tell a countermodel, by what they are in the theorem's words."""
    cited: tuple[Result, ...] = ()
    """Assumptions that other lemmas prove."""

    def citing(self, *results: Result) -> Statement:
        """The same claim, assuming what other lemmas prove; symbols that these define are arbitrary here."""
        assumptions = {result.words: result.formula for result in results}
        return replace(self, assumptions={**assumptions, **self.assumptions}, cited=results)

    def without(self, *assumptions: str) -> Statement:
        """The same claim, with less assumed."""
        for words in assumptions:
            if words not in self.assumptions:
                raise KeyError(words)
        return replace(self, assumptions={k: v for k, v in self.assumptions.items() if k not in assumptions})

    def with_changed(self, words: str, formula: Term) -> Statement:
        """The same claim, with another formula for one assumption."""
        if words not in self.assumptions:
            raise KeyError(words)
        return replace(self, assumptions={**self.assumptions, words: formula})

    def with_also(self, words: str, formula: Term) -> Statement:
        """The same claim, with one assumption more; in countermodels, it picks one that is easy to read."""
        if words in self.assumptions:
            raise KeyError(words)
        return replace(self, assumptions={**self.assumptions, words: formula})

    def claiming(self, claim: Term) -> Statement:
        return replace(self, claim=claim)


@dataclass(frozen=True, slots=True)
class Variant:
    """A statement that does not hold, and what is wrong with it in words."""

    words: str
    statement: Statement


@dataclass(frozen=True, slots=True)
class Lemma:
    """One step: a statement with at least one way to break it."""

    name: str
    words: str
    statement: Statement
    broken: tuple[Variant, ...]
    printed: tuple[Variant, ...] = ()
    """The statement as a paper printed it where that does not hold; the words tell the countermodel and the repair."""
    interesting: Term | None = None
    """What the assumptions shall be satisfiable with, so that the case is not a trivial one."""

    def __post_init__(self) -> None:
        if not self.broken:
            raise ValueError(f"lemma {self.name} has no broken variant; add one that drops what it needs")


@dataclass(frozen=True, slots=True)
class Theorem:
    """One theorem, lemma or observation, with its problems."""

    name: str
    title: str
    source: str
    words: str
    formalisation: str
    scope: Scope
    bound: str
    """What the bound is; of a general theorem, what is general about it."""
    lemmas: tuple[Lemma, ...]
    formerly: str = ""
    """The bound up to which this was shown before it was general."""
    trusted: str = ""
    """What is argued in words, or taken from another theorem of the list."""


@dataclass(frozen=True, slots=True)
class Problem:
    """One question to a solver."""

    name: str
    kind: Kind
    words: str
    script: str
    """SMT-LIB 2, up to the assertions."""
    show: dict[str, Term]

    @property
    def expected(self) -> str:
        return "unsat" if self.kind is Kind.CLAIM else "sat"

    @property
    def smt2(self) -> str:
        """The problem as a file that any solver reads."""
        return f"{self.script}(check-sat)\n"


def problems(theorem: Theorem) -> list[Problem]:
    """All questions of a theorem, claims first."""
    found = []
    for lemma in theorem.lemmas:
        start = f"{theorem.name}.{_plain(lemma.name)}"
        title = f"{theorem.title} [{theorem.source}]: {lemma.name}"
        whole = lemma.statement
        found.append(Problem(start, Kind.CLAIM, lemma.words, _script(title, whole, _denied(whole)), whole.show))
        interesting = {} if lemma.interesting is None else {"not a trivial case": lemma.interesting}
        satisfiable = _script(f"{title}: assumptions alone", whole, interesting)
        found.append(Problem(f"{start}.assumptions", Kind.ASSUMPTIONS, "assumptions alone", satisfiable, whole.show))
        for kind, variants in ((Kind.BROKEN, lemma.broken), (Kind.PRINTED, lemma.printed)):
            for index, variant in enumerate(variants, start=1):
                statement = variant.statement
                script = _script(f"{title}: {kind.value} ({variant.words})", statement, _denied(statement))
                found.append(Problem(f"{start}.{kind.value}-{index}", kind, variant.words, script, statement.show))
    return found


def _plain(name: str) -> str:
    """A lemma's name as part of a file's."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name)


def _denied(statement: Statement) -> dict[str, Term]:
    return {"the claim, denied": f"(not {statement.claim})"}


def _script(title: str, statement: Statement, more: dict[str, Term]) -> str:
    lines = [f"; {line}" for line in title.splitlines()]
    lines += ["(set-option :produce-models true)", "(set-logic ALL)", *statement.declarations]
    for words, formula in {**statement.assumptions, **more}.items():
        lines += [f"; {line}" for line in words.splitlines()]
        lines.append(f"(assert {formula})")
    return "\n".join(lines) + "\n"
