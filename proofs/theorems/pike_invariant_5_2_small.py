"""[PIKE] Invariant 5.2, bounded: all labels over two or three variables with two or three values, one by one.

A second formalisation of what `pike_invariant_5_2` proves in general: environments are given, not axiomatised.
"""

from proofs.theorems._library.environments import Universe, assign, entails, member, text
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import Term, all_of, any_of, conj, define, iff, implies, neg

MINIMAL = "the label is minimal: no environment of it entails another"
CLOSED = "the label is closed: each consensus over each variable entails an environment of it"


def implicant(environment: tuple[int, ...]) -> Term:
    return "implicant-" + "".join(map(str, environment))


def closed(universe: Universe, variables: range) -> Term:
    """What remains of one environment per value of a variable, joined, entails an environment of the label.

    If the remains are all part of some m, then their union is, and what it entails m entails; so it is enough to say it
    of every m: that also covers each union itself.
    """
    conditions = []
    for variable in variables:
        for rest in (e for e in universe.environments if e[variable] == 0):
            satellites = all_of(
                any_of(
                    member("label", e)
                    for e in universe.environments
                    if e[variable] == value and entails(rest, assign(e, variable, 0))
                )
                for value in range(1, universe.domains[variable] + 1)
            )
            conditions.append(implies(satellites, universe.holds_some("label", rest)))
    return all_of(conditions)


def primes(universe: Universe) -> Statement:
    """A label that is minimal and closed is the set of prime implicants of what it says."""
    definitions = [
        define(
            implicant(e),
            {},
            "Bool",
            all_of(universe.holds_some("label", s) for s in universe.scenarios if entails(s, e)),
        )
        for e in universe.environments
    ]
    minimal = all_of(
        neg(conj(member("label", e), member("label", part)))
        for e in universe.environments
        for part in universe.environments
        if e != part and entails(e, part)
    )
    prime = all_of(
        iff(
            member("label", e),
            conj(implicant(e), *(neg(implicant(assign(e, v, 0))) for v, value in enumerate(e) if value)),
        )
        for e in universe.environments
    )
    return Statement(
        (*universe.set_of("label"), *definitions),
        {MINIMAL: minimal, CLOSED: closed(universe, range(len(universe.domains)))},
        prime,
        {f"{text(e)} in the label": member("label", e) for e in universe.environments},
    )


THREE_VALUES = Universe((3, 3))
THREE_VARIABLES = Universe((2, 2, 2))
MIXED = Universe((3, 2, 3))


def lemma(name: str, words: str, universe: Universe) -> Lemma:
    statement = primes(universe)
    return Lemma(
        name,
        f"For {words}: a label that is minimal and closed is the set of prime implicants of what it says.",
        statement,
        (
            Variant(
                "consensus over the last variable is left out: some prime implicant may be missing.",
                statement.with_changed(CLOSED, closed(universe, range(len(universe.domains) - 1))),
            ),
            Variant(
                "the label need not be minimal: it may have implicants that are not prime.", statement.without(MINIMAL)
            ),
        ),
        interesting=any_of(member("label", e) for e in universe.environments if sum(map(bool, e)) > 1),
    )


THEOREM = Theorem(
    name="pike_invariant_5_2_small",
    title="Labels contain the prime implicants: small labels",
    source="[PIKE, Invariant 5.2]",
    words="A label over few variables that is minimal and closed under consensus is the set of prime implicants of "
    "what it says.",
    formalisation="An arbitrary set of environments, one truth value each, over all sets at once; scenarios and "
    "entailment are computed, so that nothing is assumed about them. A second look at what is proved in general above.",
    scope=Scope.BOUNDED,
    bound="all labels over two variables with three values, three with two values, and three with 3, 2 and 3 values.",
    lemmas=(
        lemma("3×3", "two variables with three values", THREE_VALUES),
        lemma("2×2×2", "three variables with two values", THREE_VARIABLES),
        lemma("3×2×3", "three variables with 3, 2 and 3 values", MIXED),
    ),
)
