"""[PIKE] §6.2.1, second observation: an executive that guesses the intent first may need to replan, at every pair."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import const, consts, forall, function, sort

PAIR = {"i": "Pair"}
OTHERS = "each choice has two outcomes at least: for each value there is another"
CONTRARY = "a human who at each pair chooses another outcome than the one that the executive then counts on"
STATEMENT = Statement(
    (
        sort("Pair"),
        sort("Value"),
        function("guess", ["Pair"], "Value"),
        function("human", ["Pair"], "Value"),
        function("robot", ["Pair"], "Value"),
        function("another", ["Value"], "Value"),
        const("pair", "Pair"),
        *consts("Value", "one"),
    ),
    {
        OTHERS: forall({"v": "Value"}, "(distinct (another v) v)"),
        CONTRARY: forall(PAIR, "(= (human i) (another (guess i)))"),
        "the robot is to make the choice that fits the guess": forall(PAIR, "(= (robot i) (guess i))"),
    },
    "(distinct (robot pair) (human pair))",
    {"guess": "(guess pair)", "human chose": "(human pair)"},
)

THEOREM = Theorem(
    name="pike_k_intents_kirk",
    title="Guessing the intent first may need replanning at every pair",
    source="[PIKE, §6.2.1, second Observation]",
    words="For every way of guessing the human's intent, even anew after each replanning, there is a human whose "
    "choices make "
    "the plan fail at each of the pairs: as many replannings as there are pairs.",
    formalisation="`guess` is what the executive counts on when the human chooses at a pair; it may depend on "
    "everything before, "
    "since each pair is decided once. The human's choices are given: at each pair another outcome.",
    scope=Scope.GENERAL,
    bound="any number of pairs with two outcomes at least, any way of guessing.",
    lemmas=(
        Lemma(
            "every pair",
            "At every pair the robot's choice does not fit the human's.",
            STATEMENT,
            (
                Variant(
                    "choices may have one outcome only: no guess is wrong.",
                    STATEMENT.without(OTHERS).with_also("one value", forall({"v": "Value"}, "(= v one)")),
                ),
                Variant("the human is any human: guesses may be right.", STATEMENT.without(CONTRARY)),
            ),
        ),
    ),
)
