"""[PIKE] §2.1, the observation on intents and adaptations."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import const, forall, function, sort

CHOICE = {"c": "Choice"}
FULL_INTENT = "the intent assigns all uncontrollable choices, and no others"
FULL_ADAPTATION = "the adaptation assigns all controllable choices, and no others"
STATEMENT = Statement(
    (
        sort("Choice"),
        *(function(name, ["Choice"], "Bool") for name in ("controllable", "intended", "adapted")),
        const("choice", "Choice"),
    ),
    {
        FULL_INTENT: forall(CHOICE, "(= (intended c) (not (controllable c)))"),
        FULL_ADAPTATION: forall(CHOICE, "(= (adapted c) (controllable c))"),
    },
    "(xor (intended choice) (adapted choice))",
    {"controllable": "(controllable choice)", "intended": "(intended choice)", "adapted": "(adapted choice)"},
)

THEOREM = Theorem(
    name="pike_observation_2",
    title="Intent and adaptation make a team scenario",
    source="[PIKE, §2.1, Observation]",
    words="An intent scenario and an adaptation scenario together assign each choice, and none twice.",
    formalisation="`Choice` is an arbitrary set, divided into controllable and uncontrollable choices.",
    scope=Scope.GENERAL,
    bound="any set of choices.",
    lemmas=(
        Lemma(
            "scenario",
            "Each choice is assigned exactly once.",
            STATEMENT,
            (
                Variant(
                    "an intent, not an intent scenario: it may leave choices open.",
                    STATEMENT.with_changed(FULL_INTENT, forall(CHOICE, "(=> (intended c) (not (controllable c)))")),
                ),
                Variant("the adaptation may assign what is not controllable.", STATEMENT.without(FULL_ADAPTATION)),
            ),
        ),
    ),
)
