"""[PIKE] Figure 12: the nine cases of a threat; which cannot occur, and that the others do what they should."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, consts, disj, implies, le, plus

NAMES = ("threat-producer", "producer-threat", "threat-consumer", "consumer-threat", "first")
UNDECIDED = "(and (not threat-producer) (not producer-threat))"
LOOSE = "(and (not threat-consumer) (not consumer-threat))"
C2 = implies(conj(UNDECIDED, "threat-consumer"), "(< t p)")
C3 = "(not (and producer-threat threat-consumer))"
C5 = implies(conj(UNDECIDED, LOOSE), "(ite first (< t p) (< c t))")
C6 = implies(conj("producer-threat", LOOSE), "(< c t)")
SAFE = "(or (< t p) (< c t))"
SHOW = {"producer": "p", "threat": "t", "consumer": "c", **{name: name for name in NAMES}}

NOW = "precedences that the distances tell hold in this execution"
RULES = "the constraint of the case holds"
CASES = Statement(
    (*consts("Real", "p", "t", "c"), *consts("Bool", *NAMES)),
    {
        NOW: "(and (=> threat-producer (< t p)) (=> producer-threat (< p t)) (=> threat-consumer (< t c)) "
        "(=> consumer-threat (< c t)))",
        RULES: conj(C2, C3, C5, C6),
    },
    SAFE,
    SHOW,
)


def without_case(which: str, *kept: str) -> Variant:
    return Variant(f"{which}.", CASES.with_changed(RULES, conj(*kept)))


COMPLETE = Statement(
    CASES.declarations,
    {
        NOW: CASES.assumptions[NOW],
        "the threat is not between producer and consumer": SAFE,
        "the order variable says what is the case": "(= first (< t p))",
    },
    conj(C2, C3, C5, C6),
    SHOW,
)

EVENTS = ("p", "t", "c")


def distance(start: str, end: str) -> str:
    return f"d-{start}{end}"


DISTANCES = tuple(const(distance(a, b), "Real") for a in EVENTS for b in EVENTS)
SHORTEST = conj(
    *(f"(= {distance(a, a)} 0.0)" for a in EVENTS),
    *(le(distance(a, b), plus(distance(a, k), distance(k, b))) for a in EVENTS for b in EVENTS for k in EVENTS),
)


def precedes(first: str, second: str) -> str:
    return f"(< {distance(second, first)} 0.0)"


INCOMPARABLE = conj("(<= 0.0 d-ct)", "(<= 0.0 d-tc)")
LINKED = "the producer precedes the consumer in the network that the distances are of"
IMPOSSIBLE = Statement(
    DISTANCES,
    {"the distances are shortest, without a negative cycle": SHORTEST, LINKED: precedes("p", "c")},
    conj(
        f"(not {conj(precedes('t', 'p'), INCOMPARABLE)})",
        f"(not {conj(precedes('t', 'p'), precedes('c', 't'))})",
        f"(not {conj('(<= 0.0 d-tp)', '(<= 0.0 d-pt)', precedes('c', 't'))})",
    ),
    {f"{b} − {a} at most": distance(a, b) for a in EVENTS for b in EVENTS if a != b},
)
NOTHING = Statement(
    CASES.declarations,
    {
        NOW: CASES.assumptions[NOW],
        "one of the cases C1, C4, C7, C8, C9, in which nothing is required": disj("threat-producer", "consumer-threat"),
    },
    SAFE,
    SHOW,
)

OWN = Statement(
    CASES.declarations,
    {
        NOW: CASES.assumptions[NOW],
        "the producer is before the consumer": "(< p c)",
        "the threat is at the producer's or the consumer's own event": "(or (= t p) (= t c))",
    },
    f"(not {conj(C2, C3, C5, C6)})",
    SHOW,
)

THEOREM = Theorem(
    name="pike_figure_12",
    title="The cases of a threat",
    source="[PIKE, Figure 12, §4.4]",
    words="The constraint of each case of Figure 12 holds, for some value of the order variable, exactly if the "
    "threat is not between producer and consumer. Cases C4, C7 "
    "and C8 are impossible only once the network has the link's own constraint; with the distances that Algorithm "
    "5 uses, "
    "which are of the network before, C4 and C8 occur. Nothing is required in them, and nothing is needed.",
    formalisation="The times of producer, threat and consumer in one execution, and what the distances tell of "
    "their order, "
    "as truth values that hold in this execution. For the impossible cases, the shortest distances between three "
    "events.",
    scope=Scope.GENERAL,
    bound="any producer, threat and consumer, any times.",
    lemmas=(
        Lemma(
            "sufficient",
            "If the constraint of the case holds, the threat is not between producer and consumer.",
            CASES,
            (
                without_case("no constraint in case C2", C3, C5, C6),
                without_case("no conflict in case C3", C2, C5, C6),
                without_case("no constraint in case C5", C2, C3, C6),
                without_case("no constraint in case C6", C2, C3, C5),
                Variant("the distances may err.", CASES.without(NOW)),
            ),
        ),
        Lemma(
            "necessary",
            "If the threat is not between producer and consumer, the constraint of the case holds, with the order "
            "variable "
            "set to what is the case.",
            COMPLETE,
            (
                Variant(
                    "the order variable may have any value.",
                    COMPLETE.without("the order variable says what is the case"),
                ),
                Variant("the distances may err.", COMPLETE.without(NOW)),
            ),
        ),
        Lemma(
            "nothing required",
            "Where the threat always precedes the producer, or always follows the consumer, it is never between "
            "them: so "
            "also in C4 and C8.",
            NOTHING,
            (Variant("the distances may err.", NOTHING.without(NOW)),),
        ),
        Lemma(
            "own event",
            "If the threat is at the producer's or the consumer's own event, no schedule meets the constraint of "
            "its case: "
            "the link is in conflict. (Algorithm 5 does not look at the consumer's event; see Theorem 4.5.)",
            OWN,
            (
                Variant(
                    "the threat may be anywhere.",
                    OWN.without("the threat is at the producer's or the consumer's own event"),
                ),
                Variant("the distances may err: a case may apply in which nothing is required.", OWN.without(NOW)),
            ),
        ),
        Lemma(
            "impossible",
            "If the producer precedes the consumer, C4, C7 and C8 do not occur.",
            IMPOSSIBLE,
            (
                Variant(
                    "the distances need not be shortest.",
                    IMPOSSIBLE.without("the distances are shortest, without a negative cycle"),
                ),
            ),
            (
                Variant(
                    '"cases C4, C7, and C8 represent impossible situations": not with the distances of the plan '
                    "before the "
                    "link's constraint is added, which Algorithm 5 uses. A threat always one before the producer, "
                    "and a "
                    "consumer at any time within 5 of both, is case C4. Nothing needs repair but the reason given.",
                    IMPOSSIBLE.without(LINKED).with_also(
                        "the threat is 1 before the producer, the consumer within 5 of both",
                        "(and (= d-pt (- 1.0)) (= d-tp 1.0) (= d-ct 4.0) (= d-tc 5.0) (= d-pc 4.0) (= d-cp 5.0))",
                    ),
                ),
            ),
        ),
    ),
)
