"""[PIKE] Invariant 5.2: labels that are closed under consensus are the prime implicants."""

from proofs.theorems._library.environments import Universe, assign, entails, member, text
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import (
    Term,
    all_of,
    any_of,
    conj,
    const,
    consts,
    define,
    exists,
    forall,
    function,
    iff,
    implies,
    neg,
    sort,
)

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


SOME = {"a": "Environment", "b": "Environment"}
WEAVE = Statement(
    (
        sort("Environment"),
        *(function(name, ["Environment"], "Bool") for name in ("first", "second", "woven", "entailed")),
        function("join", ["Environment", "Environment"], "Environment"),
        const("some", "Environment"),
    ),
    {
        "the scenario entails a join exactly if it entails both parts": forall(
            SOME, "(= (entailed (join a b)) (and (entailed a) (entailed b)))"
        ),
        "weaving joins each environment of one label with each of the other": forall(
            {"c": "Environment"},
            iff("(woven c)", exists(SOME, "(and (first a) (second b) (= c (join a b)))")),
        ),
    },
    iff(
        exists({"c": "Environment"}, "(and (woven c) (entailed c))"),
        conj(
            exists({"c": "Environment"}, "(and (first c) (entailed c))"),
            exists({"c": "Environment"}, "(and (second c) (entailed c))"),
        ),
    ),
    {"in the first": "(first some)", "in the second": "(second some)", "in the woven": "(woven some)"},
)
PAIRS = "weaving joins each environment of one label with each of the other"
SPLIT = Statement(
    (
        sort("Variable"),
        sort("Value"),
        function("scenario", ["Variable"], "Value"),
        function("in-conflict", ["Variable"], "Bool"),
        function("conflict", ["Variable"], "Value"),
        const("environment-holds", "Bool"),
        const("variable", "Variable"),
        *consts("Value", "value", "other"),
    ),
    {},
    iff(
        conj("environment-holds", neg(forall({"v": "Variable"}, "(=> (in-conflict v) (= (scenario v) (conflict v)))"))),
        exists(
            {"v": "Variable", "w": "Value"},
            "(and environment-holds (in-conflict v) (distinct w (conflict v)) (= (scenario v) w))",
        ),
    ),
    {"value of the variable": "(= (scenario variable) (conflict variable))", "in conflict": "(in-conflict variable)"},
)

THEOREM = Theorem(
    name="pike_invariant_5_2",
    title="Labels contain the prime implicants",
    source="[PIKE, Invariant 5.2]",
    words="The label of a node is the set of prime implicants of its constraint together with all conflicts: "
    "weaving, merging "
    "and splitting keep what a label says, and once consensus reaches its fixed point and no environment entails "
    "another, the "
    "label is exactly the set of prime implicants.",
    formalisation="The fixed point: an arbitrary set of environments, one truth value each, over all sets at once. "
    "Weaving and "
    "splitting: one arbitrary scenario, arbitrary labels.",
    scope=Scope.BOUNDED,
    bound="the fixed point for all labels over two variables with three values, three with two values, and three "
    "with 3, 2 "
    "and 3 values; weaving and splitting for any labels.",
    trusted="Merging two labels says what either says. A constraint with its conflicts is built from assignments "
    "by these steps.",
    lemmas=(
        lemma("3×3", "two variables with three values", THREE_VALUES),
        lemma("2×2×2", "three variables with two values", THREE_VARIABLES),
        lemma("3×2×3", "three variables with 3, 2 and 3 values", MIXED),
        Lemma(
            "weaving",
            "The woven label holds in a scenario exactly if both labels do.",
            WEAVE,
            (
                Variant(
                    "some joins are left out.",
                    WEAVE.with_changed(
                        PAIRS,
                        forall(
                            {"c": "Environment"},
                            implies("(woven c)", exists(SOME, "(and (first a) (second b) (= c (join a b)))")),
                        ),
                    ).with_also("one environment", forall(SOME, "(= a b)")),
                ),
            ),
        ),
        Lemma(
            "splitting",
            "For each variable of the conflict and each value other than the conflict's, the environment with that "
            "value "
            "added: one of these holds in a scenario exactly if the environment does and the conflict does not.",
            SPLIT,
            (
                Variant(
                    "the values that are added may be those of the conflict.",
                    SPLIT.claiming(
                        iff(
                            conj(
                                "environment-holds",
                                neg(forall({"v": "Variable"}, "(=> (in-conflict v) (= (scenario v) (conflict v)))")),
                            ),
                            exists(
                                {"v": "Variable", "w": "Value"},
                                "(and environment-holds (in-conflict v) (= (scenario v) w))",
                            ),
                        )
                    ).with_also(
                        "one variable, two values",
                        conj(
                            forall({"v": "Variable"}, "(= v variable)"),
                            forall({"w": "Value"}, "(or (= w value) (= w other))"),
                        ),
                    ),
                ),
            ),
        ),
    ),
)
