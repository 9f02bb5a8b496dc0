"""[PIKE] §5.7: how prime implicants answer whether constraints could be added; as printed, the answer can be wrong."""

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
from proofs.theorems._library.terms import conj, consts, exists, forall, function, iff, implies, sort

# -- each environment is a part of a scenario -------------------------------------------------------------------------
FREE = "if the environment is no scenario, a variable is free, and has a value"
HYPOTHESIS = "hypothesis of the induction: environments that leave fewer variables free are parts of scenarios"
COMPLETED = exists({"full": "Environment"}, "(and (scenario full) (entails full e))")
COMPLETION = Statement(
    (*ENVIRONMENTS, *INDUCTION),
    {
        FREE: "(or (scenario some) (and (not (assigned some x)) (domain x v)))",
        WITH: implies("(and (not (assigned some x)) (domain x v))", with_one("some", "x", "v")),
        FEWER: COUNTED,
        HYPOTHESIS: if_fewer(COMPLETED),
    },
    exists({"full": "Environment"}, "(and (scenario full) (entails full some))"),
    {"free variables": "(free some)", "the variable is assigned": "(assigned some x)"},
)

# -- whether constraints can be added ---------------------------------------------------------------------------------
ADDED = (
    sort("Environment"),
    function("entails", ["Environment", "Environment"], "Bool"),
    *(function(name, ["Environment"], "Bool") for name in ("scenario", "conflict", "compatible")),
    function("joined", ["Environment"], "Environment"),
    *LABEL,
    *consts("Environment", "some", "full", "assignments", "first-conflict", "second-conflict"),
)
AVOIDS = forall({"c": "Environment"}, "(=> (conflict c) (not (entails full c)))")
POSSIBLE = exists({"full": "Environment"}, conj("(scenario full)", "(says full)", "(entails full assignments)", AVOIDS))
JOINED = (
    "a scenario entails an environment and the new assignments exactly if they are compatible and it entails their join"
)
STATEMENT = Statement(
    ADDED,
    {
        JOINED: forall(
            {**ENTRY, "full": "Environment"},
            implies(
                "(scenario full)",
                "(= (and (entails full e) (entails full assignments)) (and (compatible e) (entails full (joined e))))",
            ),
        )
    },
    iff(
        exists(
            {**ENTRY, "full": "Environment"},
            conj("(label e)", "(compatible e)", "(scenario full)", "(entails full (joined e))", AVOIDS),
        ),
        POSSIBLE,
    ),
    {
        "in the label": "(label some)",
        "compatible": "(compatible some)",
        "entails the first conflict": "(entails some first-conflict)",
        "the second": "(entails some second-conflict)",
    },
)
PRINTED = iff(
    exists(
        ENTRY,
        "(and (label e) (compatible e) (forall ((c Environment)) (=> (conflict c) (not (entails (joined e) c)))))",
    ),
    POSSIBLE,
)
ONE_CONFLICT = "there is one new conflict"
AVOIDABLE = (
    "an environment that does not manifest a conflict is a part of a scenario that does not (lemma avoiding one)"
)
SINGLE = Statement(
    ADDED,
    {
        **STATEMENT.assumptions,
        ONE_CONFLICT: forall(ENTRY, "(= (conflict e) (= e first-conflict))"),
        AVOIDABLE: forall(
            {**ENTRY, "c": "Environment"},
            implies(
                "(not (entails e c))",
                exists({"full": "Environment"}, "(and (scenario full) (entails full e) (not (entails full c)))"),
            ),
        ),
        "entailment is transitive": forall(
            {**PARTS, "rest": "Environment"}, "(=> (and (entails e part) (entails part rest)) (entails e rest))"
        ),
    },
    implies(
        "(and (label some) (compatible some) (not (entails (joined some) first-conflict)))",
        exists(
            {"full": "Environment"},
            conj(
                "(scenario full)",
                "(entails full some)",
                "(entails full assignments)",
                "(not (entails full first-conflict))",
            ),
        ),
    ),
    STATEMENT.show,
)
NOT_MANIFEST = "(forall ((c Environment)) (=> (conflict c) (not (entails (joined some) c))))"
NECESSARY = Statement(
    ADDED,
    {
        **STATEMENT.assumptions,
        "entailment is transitive": SINGLE.assumptions["entailment is transitive"],
        "a scenario that avoids the conflicts": conj("(scenario full)", "(entails full assignments)", AVOIDS),
        "an environment of the label that it entails": "(and (label some) (entails full some))",
    },
    f"(and (compatible some) {NOT_MANIFEST})",
    STATEMENT.show,
)
SCENARIOS = "each environment is a part of a scenario (by induction, lemma completion)"
OTHER = "each variable has another value for each value"
AVOIDING = Statement(
    (
        *ENVIRONMENTS,
        function("other", ["Variable", "Value"], "Value"),
        function("completed", ["Environment"], "Environment"),
        *consts("Environment", "conflict"),
    ),
    {
        SCENARIOS: forall(ENTRY, "(and (scenario (completed e)) (entails (completed e) e))"),
        OTHER: forall({"y": "Variable", "w": "Value"}, "(distinct (other y w) w)"),
        WITH: implies("(not (assigned some x))", with_one("some", "x", "(other x (value conflict x))")),
    },
    implies(
        "(and (assigned conflict x) (not (and (assigned some x) (= (value some x) (value conflict x)))))",
        exists({"full": "Environment"}, "(and (scenario full) (entails full some) (not (entails full conflict)))"),
    ),
    {"the conflict has x": "(assigned conflict x)", "its value": "(value conflict x)"},
)
WORLD = "one variable with at most two values"
FEW = "three environments: one without assignments, and two scenarios, which are conflicts"
THREE = conj(
    "(distinct assignments first-conflict second-conflict)",
    forall(ENTRY, "(or (= e assignments) (= e first-conflict) (= e second-conflict))"),
    forall(PARTS, "(= (entails e part) (or (= e part) (= part assignments)))"),
    forall(ENTRY, "(= (scenario e) (distinct e assignments))"),
    forall(ENTRY, "(= (joined e) e)"),
    "(compatible assignments)",
)
ALL_ALIKE = conj(
    forall(ENTRY, "(or (= e assignments) (= e first-conflict))"),
    "(distinct assignments first-conflict)",
    forall(PARTS, "(= (entails e part) (or (= e part) (= part assignments)))"),
    forall(ENTRY, "(= (scenario e) (distinct e assignments))"),
    forall(ENTRY, "(= (joined e) e)"),
)
EXAMPLE = conj(
    THREE, forall(ENTRY, "(= (label e) (= e assignments))"), "(conflict first-conflict)", "(conflict second-conflict)"
)

THEOREM = Theorem(
    name="pike_could_commit",
    title="Whether constraints could be added",
    source="[PIKE, §5.7]",
    words="Constraints can be added to the theory exactly if some environment of the goal's label joins the new "
    "assignments and has a completion that avoids all new conflicts. That it manifests none of the conflicts, as "
    "printed, is enough for one conflict, if each variable has two values at least; with several, each may be "
    "avoidable and all together not.",
    formalisation="Environments assign some of arbitrarily many variables; the label and the conflicts are arbitrary "
    "sets of them. Possible is what Definition says: some scenario satisfies the label and the assignments and "
    "manifests no conflict. That an environment is a part of a scenario is shown by induction over how many variables "
    "it leaves free.",
    scope=Scope.INDUCTION,
    bound="any number of variables with any domains, any label, any assignments and conflicts.",
    formerly="labels, assignments and conflicts over three variables with 2, 2 and 3 values",
    trusted="The principle of induction over the number of free variables; the step is proved, and has no base, since "
    "a scenario leaves none free.",
    lemmas=(
        Lemma(
            "completion",
            "If environments that leave fewer variables free are parts of scenarios, so is this one.",
            COMPLETION,
            (
                Variant(
                    "a variable may have no value.",
                    COMPLETION.without(FREE).with_also(
                        WORLD, conj(world("some"), "(not (domain x v))", "(not (domain x (first x)))")
                    ),
                ),
                Variant(
                    "the hypothesis is not used.",
                    COMPLETION.without(HYPOTHESIS).with_also(
                        "two environments, neither of them a scenario",
                        forall(ENTRY, "(and (or (= e some) (= e (with some x v))) (not (scenario e)))"),
                    ),
                ),
            ),
            interesting=conj(
                "(not (scenario some))", world("some", "(with some x v)"), "(= v (first x))", "(= (free some) 1)"
            ),
        ),
        Lemma(
            "adding",
            "A label's environment with a completion that avoids all conflicts exists exactly if adding is possible.",
            STATEMENT,
            (
                Variant(
                    "no environment of the label is looked at, only the assignments.",
                    STATEMENT.claiming(
                        implies(
                            exists(
                                {"full": "Environment"}, conj("(scenario full)", "(entails full assignments)", AVOIDS)
                            ),
                            POSSIBLE,
                        )
                    ).with_also(FEW, THREE),
                ),
                Variant("the join is any environment.", STATEMENT.without(JOINED)),
            ),
            (
                Variant(
                    '"does not manifest any of the new conflicts": a label whose only environment is empty, with '
                    "the new conflicts {x=1} and {x=2} of a variable with two values manifests neither; no scenario "
                    "avoids both. Repair: look for a completion.",
                    STATEMENT.claiming(PRINTED).with_also(FEW, EXAMPLE),
                ),
            ),
            interesting=conj(
                THREE, "(conflict first-conflict)", "(label second-conflict)", "(compatible second-conflict)"
            ),
        ),
        Lemma(
            "no conflict manifest",
            "If adding is possible, some environment of the label joins the assignments and manifests no conflict.",
            NECESSARY,
            (
                Variant(
                    "the scenario need not avoid the conflicts.",
                    NECESSARY.without("a scenario that avoids the conflicts").with_also(FEW, THREE),
                ),
            ),
            interesting=conj(THREE, "(conflict first-conflict)"),
        ),
        Lemma(
            "one conflict",
            "With one new conflict and two values for each variable, that is enough.",
            SINGLE,
            (
                Variant(
                    "there may be several conflicts.",
                    SINGLE.claiming(PRINTED).without(ONE_CONFLICT).with_also(FEW, EXAMPLE),
                ),
                Variant(
                    "a conflict may be one that no scenario avoids.",
                    SINGLE.without(AVOIDABLE).with_also("one scenario", ALL_ALIKE),
                ),
            ),
            interesting=conj(
                THREE, "(conflict first-conflict)", "(label second-conflict)", "(compatible second-conflict)"
            ),
        ),
        Lemma(
            "avoiding one",
            "An environment that does not manifest a conflict is a part of a scenario that does not.",
            AVOIDING,
            (
                Variant(
                    "a variable may have one value only, which every scenario has.",
                    AVOIDING.without(OTHER).with_also(
                        "one variable with one value",
                        conj(
                            forall({"y": "Variable"}, "(= y x)"),
                            forall({"w": "Value"}, "(= w v)"),
                            forall(ENTRY, "(or (= e some) (= e conflict))"),
                        ),
                    ),
                ),
            ),
            interesting=conj(
                forall({"y": "Variable"}, "(= y x)"),
                forall({"w": "Value"}, "(or (= w v) (= w (first x)))"),
                "(distinct v (first x))",
                "(not (assigned some x))",
                "(assigned conflict x)",
                forall(ENTRY, "(or (= e some) (= e conflict) (= e (with some x (other x (value conflict x)))))"),
            ),
        ),
    ),
)
