"""[PIKE] §6.2.1, first observation: why no choice has to be taken back in a k-intents problem."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import const, consts, forall, function, iff, ite, sort

PAIR = {"i": "Pair"}
WAITS = "PIKE makes a choice only after the human's choice of the same pair was observed"
FOLLOWS = "and makes the choice that the theory then leaves: the same"
STATE = (
    sort("Pair"),
    sort("Value"),
    *(function(name, ["Pair"], "Bool") for name in ("observed", "made")),
    *(function(name, ["Pair"], "Value") for name in ("human", "robot", "human-later", "robot-later", "any")),
    const("pair", "Pair"),
    const("next", "Pair"),
    *consts("Value", "one", "two"),
)
REST = {
    "a scenario: the human's choices as observed, others any; the robot's are the same": forall(
        PAIR,
        f"(and (= (human-later i) {ite('(observed i)', '(human i)', '(any i)')}) (= (robot-later i) (human-later i)))",
    )
}
ALIVE = Statement(
    STATE,
    {
        WAITS: forall(PAIR, "(=> (made i) (observed i))"),
        FOLLOWS: forall(PAIR, "(=> (made i) (= (robot i) (human i)))"),
        **REST,
    },
    "(and (= (robot-later pair) (human-later pair)) (=> (observed pair) (= (human-later pair) (human pair))) "
    "(=> (made pair) (= (robot-later pair) (robot pair))))",
    {
        "observed": "(observed pair)",
        "made": "(made pair)",
        "human chose": "(human pair)",
        "robot chose": "(robot pair)",
    },
)
SMALL = "one pair, two values"
ONE = "(and (forall ((i Pair)) (= i pair)) (distinct one two) (forall ((v Value)) (or (= v one) (= v two))))"
LEFT = Statement(
    STATE,
    {
        "the theory: both choices of each pair are the same": forall(PAIR, "(= (robot-later i) (human-later i))"),
        "the human's choice was observed": "(and (observed pair) (= (human-later pair) (human pair)))",
    },
    "(= (robot-later pair) (human pair))",
    {"human chose": "(human pair)", "robot may choose": "(robot-later pair)"},
)

ACTIVITIES = "each outcome activates its activity: the human's has the effect, the robot's the condition"
PLAN = Statement(
    (
        sort("Pair"),
        sort("Value"),
        *(function(name, ["Pair"], "Value") for name in ("human", "robot")),
        *(function(name, ["Pair", "Value"], "Bool") for name in ("human-acts", "robot-acts")),
        *(function(name, ["Pair", "Value"], "Real") for name in ("effect-at", "condition-at")),
        const("pair", "Pair"),
        *consts("Value", "one", "two"),
    ),
    {
        ACTIVITIES: forall(
            {"i": "Pair", "v": "Value"},
            "(and (= (human-acts i v) (= (human i) v)) (= (robot-acts i v) (= (robot i) v)))",
        ),
        "the human's activity of a pair ends before the robot's starts": forall(
            {"i": "Pair", "v": "Value", "w": "Value"}, "(< (effect-at i v) (condition-at i w))"
        ),
    },
    iff(
        forall(
            {"i": "Pair", "v": "Value"},
            "(=> (robot-acts i v) (and (human-acts i v) (< (effect-at i v) (condition-at i v))))",
        ),
        forall(PAIR, "(= (robot i) (human i))"),
    ),
    {"human chose": "(human pair)", "robot chose": "(robot pair)"},
)

THEOREM = Theorem(
    name="pike_k_intents",
    title="A k-intents problem stays solvable without taking choices back",
    source="[PIKE, §6.2.1, first Observation]",
    words="In a k-intents problem, a scenario is causally complete exactly if both choices of each pair are the same. "
    "An executive that waits for the human's choice of a pair and then makes the same always has a scenario left that "
    "is, whatever the human has chosen so far; and after the human's choice there is no other value for the robot's. "
    "The paper concludes that PIKE never replans; that PIKE waits and then makes that choice is not shown here.",
    formalisation="`Pair` and `Value` are arbitrary sets. The state says which human choices were observed and "
    "which robot "
    "choices made; the theory says that the two of each pair are the same. A scenario that continues is given.",
    scope=Scope.GENERAL,
    bound="any number of pairs and outcomes, at any moment of the execution.",
    trusted="The activities of a k-intents problem follow each other without deadlines, so that every scenario is "
    "temporally "
    "consistent whatever the durations turn out to be. No activity deletes a condition.",
    lemmas=(
        Lemma(
            "theory",
            "Each condition of an active activity has its effect before it exactly if the choices of each pair are "
            "the same.",
            PLAN,
            (
                Variant(
                    "the robot's activity may start before the human's ends.",
                    PLAN.without("the human's activity of a pair ends before the robot's starts").with_also(SMALL, ONE),
                ),
                Variant("any activity may be active.", PLAN.without(ACTIVITIES).with_also(SMALL, ONE)),
            ),
            interesting="(distinct one two)",
        ),
        Lemma(
            "alive",
            "At every moment some scenario satisfies the theory and agrees with all choices so far.",
            ALIVE,
            (
                Variant(
                    "the robot may choose before the human does, and the human otherwise.",
                    ALIVE.without(WAITS, FOLLOWS).with_also(SMALL, ONE),
                ),
                Variant(
                    "the robot may make another choice than the human's.", ALIVE.without(FOLLOWS).with_also(SMALL, ONE)
                ),
            ),
            interesting="(and (observed pair) (made pair) (distinct pair next) (not (observed next)))",
        ),
        Lemma(
            "one value left",
            "After the human's choice the theory leaves one value for the robot's.",
            LEFT,
            (
                Variant(
                    "the human's choice was not observed.",
                    LEFT.without("the human's choice was observed").with_also(SMALL, ONE),
                ),
                Variant(
                    "causal links do not tie the choices of a pair.",
                    LEFT.without("the theory: both choices of each pair are the same").with_also(SMALL, ONE),
                ),
            ),
        ),
    ),
)
