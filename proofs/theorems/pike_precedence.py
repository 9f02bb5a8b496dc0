"""[PIKE] §4.1: what precedence says, and what incomparability does not."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.network import FINITE, NETWORK, SHORTEST, TRIANGLE, only
from proofs.theorems._library.terms import conj, consts, forall, function

PAIR = consts("Event", "one", "two")
TWO = "two events"
ONLY_TWO = only("one", "two")
SHOW = {"second at most after the first by": "(d one two)", "first at most after the second by": "(d two one)"}
MEETS = "the schedule is consistent"
SCHEDULE = forall({"i": "Event", "j": "Event"}, "(<= (- (time j) (time i)) (d i j))")
PRECEDES = "the first precedes the second: the distance back is negative"
ORDER = Statement(
    (*NETWORK, *PAIR, function("time", ["Event"], "Real")),
    {**SHORTEST, PRECEDES: "(< (d two one) 0.0)", MEETS: SCHEDULE},
    "(< (time one) (time two))",
    {**SHOW, "first at": "(time one)", "second at": "(time two)"},
)
BOTH = Statement((*NETWORK, *PAIR), dict(SHORTEST), "(not (and (< (d two one) 0.0) (< (d one two) 0.0)))", SHOW)
NEITHER = "neither precedes the other"
LATE = "one schedule: each event at its distance from the first"
EARLY = "another: each event at its distance from the second"


def meets(source: str) -> str:
    return forall({"i": "Event", "j": "Event"}, f"(<= (- (d {source} j) (d {source} i)) (d i j))")


INCOMPARABLE = Statement(
    (*NETWORK, *PAIR),
    {**SHORTEST, NEITHER: "(and (<= 0.0 (d one two)) (<= 0.0 (d two one)))"},
    conj(meets("one"), meets("two"), "(<= (d one one) (d one two))", "(<= (d two two) (d two one))"),
    SHOW,
)
STRICT = conj(meets("one"), meets("two"), "(< (d one one) (d one two))", "(< (d two two) (d two one))")

THEOREM = Theorem(
    name="pike_precedence",
    title="Precedence and incomparability",
    source="[PIKE, §4.1, Definitions 4.2–4.3]",
    words="If e precedes f, then e is before f in every consistent execution. Not both precede each other. If "
    "neither does, some "
    "consistent execution has e at or before f, and some has f at or before e; before, as printed, need not be: "
    "they may be "
    "tied to one instant.",
    formalisation="The shortest distances of one context without a negative cycle; schedules are given by "
    "distances from "
    "one of the events.",
    scope=Scope.GENERAL,
    bound="any number of events, any distances. " + FINITE,
    lemmas=(
        Lemma(
            "order",
            "An event that precedes another is before it in every consistent schedule.",
            ORDER,
            (
                Variant(
                    "the distance back may be zero.",
                    ORDER.with_changed(PRECEDES, "(<= (d two one) 0.0)").with_also(TWO, ONLY_TWO),
                ),
            ),
        ),
        Lemma(
            "not both",
            "Not both precede each other.",
            BOTH,
            (Variant("distances are not shortest.", BOTH.without(TRIANGLE).with_also(TWO, ONLY_TWO)),),
        ),
        Lemma(
            "incomparable",
            "If neither precedes the other, there are consistent schedules with the one first or at once, and the "
            "other.",
            INCOMPARABLE,
            (Variant("one of them precedes.", INCOMPARABLE.without(NEITHER).with_also(TWO, ONLY_TWO)),),
            (
                Variant(
                    '"executions in which e_i comes before e_j, and others in which e_j comes before e_i": two '
                    "events tied "
                    "to one instant are incomparable, and neither is ever before the other. Repair: at or before.",
                    INCOMPARABLE.claiming(STRICT)
                    .with_also(TWO, ONLY_TWO)
                    .with_also("tied together", "(and (= (d one two) 0.0) (= (d two one) 0.0))"),
                ),
            ),
        ),
    ),
)
