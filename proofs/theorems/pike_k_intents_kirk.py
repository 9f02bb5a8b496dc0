"""[PIKE] §6.2.1, second observation: for every way of guessing the intent first, some human proves each guess wrong."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, consts, forall, function, sort

OTHERS = "each choice has two outcomes at least: for each value there is another"
CONTRARY = "the human: at each pair another outcome than the executive counts on after what happened before"
GUESSED = "the robot is to make the choice that fits the guess"
FAILS = Statement(
    (
        sort("History"),
        sort("Value"),
        function("guess", ["History"], "Value"),
        function("another", ["Value"], "Value"),
        const("history", "History"),
        *consts("Value", "human", "robot"),
    ),
    {
        OTHERS: forall({"v": "Value"}, "(distinct (another v) v)"),
        CONTRARY: "(= human (another (guess history)))",
        GUESSED: "(= robot (guess history))",
    },
    "(distinct robot human)",
    {"guess": "(guess history)", "human chose": "human"},
)
EACH = "the choices of each pair differ (lemma every pair)"
COUNTED = "failures are counted"
SO_FAR = "so far there were as many as pairs"
COUNT = Statement(
    (
        sort("Value"),
        *(function(name, ["Int"], "Value") for name in ("human", "robot")),
        function("failures", ["Int"], "Int"),
        const("n", "Int"),
    ),
    {
        EACH: "(distinct (robot n) (human n))",
        COUNTED: conj(
            "(= (failures 0) 0)", "(= (failures (+ n 1)) (+ (failures n) (ite (= (robot n) (human n)) 0 1)))"
        ),
        SO_FAR: "(= (failures n) n)",
    },
    "(= (failures (+ n 1)) (+ n 1))",
    {"failures": "(failures (+ n 1))", "pairs": "(+ n 1)"},
)

THEOREM = Theorem(
    name="pike_k_intents_kirk",
    title="Guessing the intent first may fail at every pair",
    source="[PIKE, §6.2.1, second Observation]",
    words="For every way of guessing the human's choice of a pair from the choices before, there is a human with whose "
    "choices every guess is wrong: as many failures as there are pairs. That Kirk guesses in this way, and replans at "
    "each failure, is the paper's description of it and not shown here.",
    formalisation="`guess` is what the executive counts on after a history of human choices: any function. The human "
    "is given: after each history another outcome than the guess.",
    scope=Scope.INDUCTION,
    bound="any number of pairs with two outcomes at least, any way of guessing from the choices before.",
    formerly="guesses were fixed for each pair, and failures not counted",
    trusted="The induction over pairs, which begins with no failure at no pair; its step is proved.",
    lemmas=(
        Lemma(
            "every pair",
            "At every pair the robot's choice does not fit the human's.",
            FAILS,
            (
                Variant(
                    "choices may have one outcome only: no guess is wrong.",
                    FAILS.without(OTHERS).with_also("one value", forall({"v": "Value"}, "(= v human)")),
                ),
                Variant("the human is any human: guesses may be right.", FAILS.without(CONTRARY)),
            ),
        ),
        Lemma(
            "count",
            "With one pair more, there is one failure more.",
            COUNT,
            (
                Variant("the choices of a pair may agree.", COUNT.without(EACH)),
                Variant("there were fewer before.", COUNT.without(SO_FAR)),
            ),
            interesting="(= n 2)",
        ),
    ),
)
