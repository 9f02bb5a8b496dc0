"""[PIKE] Theorem 4.2: dominated causal links are irrelevant; and what Algorithm 5's single set drops besides."""

from proofs.theorems._library.causal import EVENTS, events, last_producer, only, supports, told
from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, define, exists, forall, function, implies, neg

PRODUCER = {"p": "Event"}
ACTIVATED = "whenever consumer and dominated producer are active, so is the dominating producer"
LATER = "the dominating producer comes later than the dominated one"
BEFORE = "and before the consumer"
CONSUMER = "the consumer is active, and has a support"
SUPPORTED = conj("(active consumer)", exists(PRODUCER, "(supports p)"))
ALL = conj("(active dominating)", "(active dominated)", "(active consumer)")
ONE = Statement(
    (*EVENTS, *events("consumer", "dominating", "dominated", "threat"), supports("consumer")),
    {
        "a dominating and a dominated producer": "(and (adds dominating) (adds dominated))",
        ACTIVATED: "(=> (and (active dominated) (active consumer)) (active dominating))",
        LATER: implies(ALL, "(< (time dominated) (time dominating))"),
        BEFORE: implies(ALL, "(< (time dominating) (time consumer))"),
        CONSUMER: SUPPORTED,
    },
    exists(PRODUCER, "(and (distinct p dominated) (supports p))"),
    told("dominated", "dominating", "consumer"),
)
THREE = "three events"
ONLY_THREE = conj(only("dominated", "dominating", "consumer"), "(not (deletes dominated))")
FIRST = conj(ONLY_THREE, "(not (deletes dominating))", "(not (adds consumer))", "(not (deletes consumer))")

PAIR = {"i": "Event", "j": "Event"}
CO_ACTIVE = "(and (active i) (active j) (active consumer))"
LAST = "if producers come before the consumer, one of them is the last"
DOMINANCE = "dominance between any two producers is as for the two above"
MANY = Statement(
    (*EVENTS, function("dominates", ["Event", "Event"], "Bool"), *events("consumer", "last"), supports("consumer")),
    {
        DOMINANCE: forall(
            PAIR,
            implies(
                "(dominates i j)",
                conj(
                    "(adds i)",
                    "(=> (and (active j) (active consumer)) (active i))",
                    implies(CO_ACTIVE, "(and (< (time j) (time i)) (< (time i) (time consumer)))"),
                ),
            ),
        ),
        LAST: last_producer("last", "consumer"),
        CONSUMER: SUPPORTED,
    },
    conj("(supports last)", forall({"i": "Event"}, neg("(dominates i last)"))),
    told("last", "consumer"),
)

CHOSEN = "a producer is chosen, active and before the consumer"
RESOLVED = "active threats that were kept are not between the chosen producer and the consumer"
DROPPED = (
    "a threat that was dropped is dominated: an active producer, or an active threat that was kept, comes after it "
    "and before "
    "the consumer"
)
KEPT_LATER = conj(
    "(active (later t))",
    "(< (time t) (time (later t)))",
    "(< (time (later t)) (time consumer))",
    "(or (adds (later t)) (and (deletes (later t)) (not (dropped (later t)))))",
)
THREATS = Statement(
    (
        *EVENTS,
        function("dropped", ["Event"], "Bool"),
        function("later", ["Event"], "Event"),
        *events("consumer", "chosen", "last", "threat"),
        supports("consumer"),
    ),
    {
        "the consumer is active": "(active consumer)",
        CHOSEN: "(and (adds chosen) (active chosen) (< (time chosen) (time consumer)))",
        LAST: last_producer("last", "consumer"),
        RESOLVED: forall(
            {"t": "Event"},
            implies(
                "(and (deletes t) (active t) (not (dropped t)))",
                "(or (< (time t) (time chosen)) (< (time consumer) (time t)))",
            ),
        ),
        DROPPED: forall({"t": "Event"}, implies("(and (deletes t) (active t) (dropped t))", KEPT_LATER)),
    },
    "(supports last)",
    told("chosen", "threat", "last", "consumer"),
)

EFFECT_GONE = define("adds-less", {"e": "Event"}, "Bool", "(and (adds e) (distinct e dominated))")
OTHERS = Statement(
    (
        *EVENTS,
        *events("consumer", "second", "dominating", "dominated"),
        EFFECT_GONE,
        supports("consumer"),
        supports("second", name="supports-second"),
        supports("consumer", name="supports-less", adds="adds-less"),
        supports("second", name="supports-second-less", adds="adds-less"),
    ),
    {
        "a dominating and a dominated producer": "(and (adds dominating) (adds dominated))",
        ACTIVATED: "(=> (and (active dominated) (active consumer)) (active dominating))",
        LATER: implies(ALL, "(< (time dominated) (time dominating))"),
        BEFORE: implies(ALL, "(< (time dominating) (time consumer))"),
        CONSUMER: SUPPORTED,
        "a second consumer of the same condition is active, and has a support": conj(
            "(active second)", exists(PRODUCER, "(supports-second p)")
        ),
    },
    conj(exists(PRODUCER, "(supports-less p)"), exists(PRODUCER, "(supports-second p)")),
    told("dominated", "second", "dominating", "consumer"),
)
EXAMPLE = conj(
    only("dominated", "second", "dominating", "consumer"),
    "(= (time dominated) 0.0)",
    "(= (time second) 1.0)",
    "(= (time dominating) 2.0)",
    "(= (time consumer) 3.0)",
    *(f"(not (deletes {each}))" for each in ("dominated", "second", "dominating", "consumer")),
    "(not (adds consumer))",
    "(not (adds second))",
)

THEOREM = Theorem(
    name="pike_theorem_4_2",
    title="Dominated causal links are irrelevant",
    source="[PIKE, Theorem 4.2]",
    words="A consumer that has a support has one whose causal link no other link dominates: dominated links of a "
    "consumer "
    "may be dropped, all at once. Condition 1 of Definition 4.5 may be weakened to φ_Pj ∧ φ_c ⊨ φ_Pi. The proof as "
    "printed "
    "takes the effect away from the dominated producer altogether; that may cost another consumer its support.",
    formalisation="One execution, with arbitrarily many events; `adds` and `deletes` are effects on the condition. "
    "A support is "
    "an active producer strictly before the consumer, with no active threat in the closed interval between them. "
    "Guards and "
    "precedence appear as what they say about this execution.",
    scope=Scope.GENERAL,
    bound="any number of events, any execution.",
    trusted="Finitely many events have a last one; that is assumed where it is used.",
    lemmas=(
        Lemma(
            "one link",
            "A consumer with a support has another than a dominated producer.",
            ONE,
            (
                Variant("the dominating producer need not be active.", ONE.without(ACTIVATED).with_also(THREE, FIRST)),
                Variant(
                    "the dominating producer may come after the consumer.", ONE.without(BEFORE).with_also(THREE, FIRST)
                ),
                Variant(
                    "the dominating producer may come earlier; a threat between the two spoils it.",
                    ONE.without(LATER).with_also("four events", only("dominating", "threat", "dominated", "consumer")),
                ),
            ),
        ),
        Lemma(
            "all links",
            "The last producer supports, and no link dominates its own: dropping all dominated links at once "
            "leaves it.",
            MANY,
            (
                Variant(
                    "the dominating link may have any time.",
                    MANY.with_changed(DOMINANCE, "true").with_also(
                        "two events",
                        conj(only("last", "consumer"), "(not (adds consumer))", "(not (deletes consumer))"),
                    ),
                ),
            ),
        ),
        Lemma(
            "dropped threats",
            "One set ξ for producers and threats, as in Algorithm 5, drops threats that a later producer dominates "
            "as well. A "
            "link may then hold although it is threatened; but the consumer has a support: the last producer.",
            THREATS,
            (
                Variant(
                    "threats may be dropped without reason.",
                    THREATS.without(DROPPED).with_also("three events", only("chosen", "threat", "consumer")),
                ),
                Variant(
                    "kept threats may be anywhere.",
                    THREATS.without(RESOLVED).with_also("three events", only("chosen", "threat", "consumer")),
                ),
            ),
            (
                Variant(
                    '"any threat cannot occur between e_P and e_c" (proof of Theorem 4.5) is not so with '
                    "Algorithm 5: the "
                    "chosen producer at 0, a dropped threat at 1, a producer that dominates it at 2, the consumer "
                    "at 3. What "
                    "holds is that the consumer has a support.",
                    THREATS.claiming("(supports chosen)")
                    .with_also("four events", only("chosen", "threat", "last", "consumer"))
                    .with_also(
                        "their times",
                        "(and (= (time chosen) 0.0) (= (time threat) 1.0) (= (time last) 2.0) (= (time consumer) 3.0) "
                        "(deletes threat) (active threat) (dropped threat))",
                    ),
                ),
            ),
        ),
        Lemma(
            "dropped producers",
            "A producer that a later active threat dominates supports nothing, so that it may be dropped, too.",
            DEAD := Statement(
                (*EVENTS, *events("consumer", "producer", "threat"), supports("consumer")),
                {
                    "the threat is active whenever producer and consumer are": (
                        "(=> (and (active producer) (active consumer)) (active threat))"
                    ),
                    "the consumer is active": "(active consumer)",
                    "a threat": "(deletes threat)",
                    "it comes after the producer and before the consumer": implies(
                        "(and (active threat) (active producer) (active consumer))",
                        "(and (< (time producer) (time threat)) (< (time threat) (time consumer)))",
                    ),
                },
                "(not (supports producer))",
                told("producer", "threat", "consumer"),
            ),
            (
                Variant(
                    "the threat need not be active.",
                    DEAD.without("the threat is active whenever producer and consumer are").with_also(
                        "three events", only("producer", "threat", "consumer")
                    ),
                ),
            ),
        ),
        Lemma(
            "other consumers",
            "Dropping the link of one consumer leaves the support of every other one alone.",
            OTHERS,
            (
                Variant(
                    "the dominating producer may come after the consumer.",
                    OTHERS.without(BEFORE).with_also(
                        "four events", only("dominated", "second", "dominating", "consumer")
                    ),
                ),
            ),
            (
                Variant(
                    "the proof in Appendix A removes p from the effects of the dominated producer and concludes "
                    "that only the "
                    "support of e_c could be lost. A second consumer at 1, between the dominated producer at 0 and the "
                    "dominating one at 2, loses its support. Repair: drop the link, not the effect.",
                    OTHERS.claiming(
                        conj(exists(PRODUCER, "(supports-less p)"), exists(PRODUCER, "(supports-second-less p)"))
                    ).with_also("four events", EXAMPLE),
                ),
            ),
        ),
    ),
)
