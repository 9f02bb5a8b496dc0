"""[PIKE] Invariant 5.2: labels that are closed under consensus are the prime implicants."""

from proofs.theorems._library.labels import (
    COUNTED,
    ENTRY,
    ENVIRONMENTS,
    FEWER,
    INDUCTION,
    LABEL,
    PARTS,
    WITH,
    if_fewer,
    with_one,
    world,
)
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, consts, exists, forall, function, iff, implies, neg, sort

# -- a label that is closed has a part of each implicant: induction over the variables that an implicant leaves free ---
FREE = "(not (assigned some x))"
EXTENDED = forall({"w": "Value"}, "(=> (domain x w) (says (with some x w)))")
PICKED = "for each value of the variable, an environment of the label that the environment with this value entails"
CLOSED = (
    "closed: what remains of these, if each assigns the variable, is joined, and entails an environment of the label"
)
SMALLER = Statement(
    (*ENVIRONMENTS, *LABEL),
    {WITH: with_one("some", "x", "v"), "the variable is free": FREE},
    "(=> (implicant some) (implicant (with some x v)))",
    {"the variable is free": FREE},
)
FULL = Statement(
    (*ENVIRONMENTS, *LABEL),
    {"the environment is a scenario": "(scenario some)"},
    "(=> (implicant some) (says some))",
    {"in the label": "(label some)"},
)
CONSENSUS = Statement(
    (*ENVIRONMENTS, *LABEL, function("pick", ["Value"], "Environment"), const("consensus", "Environment")),
    {
        WITH: forall({"w": "Value"}, implies("(domain x w)", with_one("some", "x", "w"))),
        PICKED: forall(
            {"w": "Value"},
            implies(
                "(and (domain x w) (says (with some x w)))", "(and (label (pick w)) (entails (with some x w) (pick w)))"
            ),
        ),
        CLOSED: implies(
            forall({"w": "Value"}, "(=> (domain x w) (assigned (pick w) x))"),
            conj(
                forall(
                    {"y": "Variable"},
                    implies(
                        "(assigned consensus y)",
                        conj(
                            "(distinct y x)",
                            exists(
                                {"w": "Value"},
                                "(and (domain x w) (assigned (pick w) y) (= (value consensus y) (value (pick w) y)))",
                            ),
                        ),
                    ),
                ),
                "(says consensus)",
            ),
        ),
    },
    implies(conj(FREE, EXTENDED), "(says some)"),
    {"in the label": "(label some)", "the variable is free": FREE},
)
BY_SMALLER = "implicants with one more assignment are implicants (lemma one more)"
BY_FULL = "a scenario that is an implicant has an environment of the label as a part (lemma scenarios)"
BY_CONSENSUS = "an environment has one as a part if it does with each value of a variable (lemma consensus)"
HYPOTHESIS = "hypothesis of the induction: implicants that leave fewer variables free have one as a part"
COVER = Statement(
    (*ENVIRONMENTS, *INDUCTION, *(function(name, ["Environment"], "Bool") for name in ("implicant", "says"))),
    {
        BY_SMALLER: forall(
            {"w": "Value"}, implies(conj("(implicant some)", FREE, "(domain x w)"), "(implicant (with some x w))")
        ),
        BY_FULL: "(=> (scenario some) (=> (implicant some) (says some)))",
        BY_CONSENSUS: implies(conj(FREE, EXTENDED), "(says some)"),
        "if it is no scenario, the variable is one that it leaves free": "(or (scenario some) (not (assigned some x)))",
        FEWER: COUNTED,
        HYPOTHESIS: if_fewer("(=> (implicant e) (says e))"),
    },
    "(=> (implicant some) (says some))",
    {"an implicant": "(implicant some)", "free variables": "(free some)"},
)

# -- so its environments are the prime implicants ---------------------------------------------------------------------
ORDER = Statement(
    (*ENVIRONMENTS, *consts("Environment", "a", "b", "c")),
    {
        "environments with the same assignments are the same": forall(
            PARTS,
            implies(
                forall(
                    {"y": "Variable"},
                    "(and (= (assigned e y) (assigned part y)) (=> (assigned e y) (= (value e y) (value part y))))",
                ),
                "(= e part)",
            ),
        )
    },
    "(and (entails a a) (=> (and (entails a b) (entails b c)) (entails a c)) "
    "(=> (and (entails a b) (entails b a)) (= a b)))",
    {"the same": "(= a b)"},
)
MINIMAL = "minimal: no environment of the label entails another"
COVERED = "closed, so that each implicant entails an environment of the label (by induction, lemma cover)"
PRIME = forall({"part": "Environment"}, "(=> (and (implicant part) (entails some part)) (= part some))")
PRIMES = Statement(
    (
        sort("Environment"),
        function("scenario", ["Environment"], "Bool"),
        function("entails", ["Environment", "Environment"], "Bool"),
        *LABEL,
        *consts("Environment", "some", "other"),
    ),
    {
        "entailment is an order (lemma entailment)": conj(
            forall(ENTRY, "(entails e e)"),
            forall(
                {**PARTS, "rest": "Environment"}, "(=> (and (entails e part) (entails part rest)) (entails e rest))"
            ),
            forall(PARTS, "(=> (and (entails e part) (entails part e)) (= e part))"),
        ),
        MINIMAL: forall(PARTS, "(=> (and (label e) (label part) (entails e part)) (= e part))"),
        COVERED: forall(ENTRY, "(=> (implicant e) (says e))"),
    },
    iff("(label some)", conj("(implicant some)", PRIME)),
    {"in the label": "(label some)", "scenario": "(scenario some)"},
)
TWO = "two environments"
ONLY_TWO = conj("(distinct some other)", forall(ENTRY, "(or (= e some) (= e other))"))
KEPT = "an environment is left out only if it entails another one of the label"
MINIMALLY = Statement(
    (
        sort("Environment"),
        *(function(name, ["Environment"], "Bool") for name in ("label", "kept", "entailed")),
        function("instead", ["Environment"], "Environment"),
        const("some", "Environment"),
    ),
    {
        "what is kept is of the label": forall(ENTRY, "(=> (kept e) (label e))"),
        KEPT: forall(
            ENTRY,
            implies(
                "(and (label e) (not (kept e)))", "(and (kept (instead e)) (=> (entailed e) (entailed (instead e))))"
            ),
        ),
    },
    iff(exists(ENTRY, "(and (label e) (entailed e))"), exists(ENTRY, "(and (kept e) (entailed e))")),
    {"kept": "(kept some)", "the scenario entails it": "(entailed some)"},
)

# -- what a label says is kept ----------------------------------------------------------------------------------------
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
            {"c": "Environment"}, iff("(woven c)", exists(SOME, "(and (first a) (second b) (= c (join a b)))"))
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


ONE_VARIABLE = "one variable with two values"
SMALL = world("some", "(with some x v)", "(with some x (first x))")

THEOREM = Theorem(
    name="pike_invariant_5_2",
    title="Labels contain the prime implicants",
    source="[PIKE, Invariant 5.2]",
    words="The label of a node is the set of prime implicants of its constraint together with all conflicts: "
    "weaving, splitting and adding minimally keep what a label says, and once consensus reaches its fixed point and no "
    "environment entails another, the label is exactly the set of prime implicants.",
    formalisation="Environments assign some of arbitrarily many variables. An implicant of what the label says entails "
    "an environment of the label: by induction over how many variables it leaves free. A scenario does; and if an "
    "implicant does with each value of a free variable, either one of these environments does not assign the variable, "
    "or their consensus is a part of the implicant, and the label is closed. Weaving and splitting: one arbitrary "
    "scenario, arbitrary labels.",
    scope=Scope.INDUCTION,
    bound="any number of variables with any domains, any label.",
    formerly="labels over two variables with three values, three with two, and three with 3, 2 and 3",
    trusted="The principle of induction over the number of free variables; the step is proved, and has no base, since "
    "a scenario leaves none free. Merging two labels says what either says. A constraint with its conflicts is built "
    "from assignments by these steps. There are finitely many environments, so that the fixed point is reached.",
    lemmas=(
        Lemma(
            "one more",
            "An implicant with one more assignment is an implicant.",
            SMALLER,
            (
                Variant(
                    "the variable is assigned already, and gets another value.",
                    SMALLER.without("the variable is free").with_also(
                        ONE_VARIABLE, conj(world("some", "(with some x v)"), "(assigned some x)")
                    ),
                ),
            ),
            interesting=conj("(implicant some)", "(label some)", SMALL),
        ),
        Lemma(
            "scenarios",
            "A scenario that is an implicant entails an environment of the label.",
            FULL,
            (
                Variant(
                    "the environment need not be a scenario.",
                    FULL.without("the environment is a scenario").with_also(ONE_VARIABLE, SMALL),
                ),
            ),
            interesting="(implicant some)",
        ),
        Lemma(
            "consensus",
            "If an environment entails one of the label with each value of a variable, it does without the variable.",
            CONSENSUS,
            (Variant("the label is not closed.", CONSENSUS.without(CLOSED).with_also(ONE_VARIABLE, SMALL)),),
            interesting=conj(
                FREE,
                EXTENDED,
                "(domain x v)",
                "(distinct v (first x))",
                "(not (label some))",
                "(assigned some other)",
                "(label consensus)",
            ).replace("(assigned some other)", "(distinct consensus some)"),
        ),
        Lemma(
            "cover",
            "If implicants that leave fewer variables free entail an environment of the label, so does this one.",
            COVER,
            (
                Variant("the hypothesis is not used.", COVER.without(HYPOTHESIS).with_also(ONE_VARIABLE, SMALL)),
                Variant("the label is not closed.", COVER.without(BY_CONSENSUS).with_also(ONE_VARIABLE, SMALL)),
                Variant("scenarios are not looked at.", COVER.without(BY_FULL).with_also(ONE_VARIABLE, SMALL)),
            ),
            interesting=conj("(implicant some)", FREE, "(domain x v)", SMALL),
        ),
        Lemma(
            "entailment",
            "Entailment of environments is reflexive, transitive and antisymmetric.",
            ORDER,
            (
                Variant(
                    "environments may differ in more than their assignments.",
                    ORDER.without("environments with the same assignments are the same"),
                ),
            ),
        ),
        Lemma(
            "prime implicants",
            "A label that is minimal and closed is the set of prime implicants of what it says.",
            PRIMES,
            (
                Variant(
                    "the label is not closed: some prime implicant may be missing.",
                    PRIMES.without(COVERED).with_also(TWO, ONLY_TWO),
                ),
                Variant(
                    "the label need not be minimal: it may have implicants that are not prime.",
                    PRIMES.without(MINIMAL).with_also(TWO, ONLY_TWO),
                ),
            ),
            interesting=conj(ONLY_TWO, "(label some)", "(not (label other))"),
        ),
        Lemma(
            "adding minimally",
            "A label from which environments are left out that entail others says the same.",
            MINIMALLY,
            (
                Variant("any environment is left out.", MINIMALLY.without(KEPT)),
                Variant("others are added.", MINIMALLY.without("what is kept is of the label")),
            ),
        ),
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
