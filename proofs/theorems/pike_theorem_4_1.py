"""[PIKE] Theorem 4.1: a candidate subplan is inconsistent exactly if it has a temporal conflict.

Distances are pairs: a number, and minus how many strict bounds it is a sum of, compared in that order. So the theorem
is about strict bounds as well, which the augmented plan has.
"""

from proofs.theorems._library.augmented import EXECUTIONS, EXTENDED_RUN
from proofs.theorems._library.model import Lemma, Result, Scope, Statement, Theorem, Variant
from proofs.theorems._library.network import FINITE
from proofs.theorems._library.terms import (
    Command,
    Term,
    conj,
    const,
    consts,
    define,
    forall,
    function,
    iff,
    implies,
    ite,
    sort,
)

PAIR = {"i": "Event", "j": "Event"}
SHORTER = define(
    "shorter", {"x": "Real", "k": "Real", "y": "Real", "l": "Real"}, "Bool", "(or (< x y) (and (= x y) (<= k l)))"
)

# -- labels: what the algorithm does to labeled values is, in one scenario, what it does to distances -----------------
LEAST = "the distances are the least values whose labels hold in the scenario"
MERGED = "the new entry has the old values, and each sum of two values, where both labels hold"


def _least(name: str, members: str) -> Term:
    """`name` is the least value of the members whose label holds."""
    return conj(
        f"({members} {name}-best)",
        f"(holds {name}-best)",
        f"(= {name} (far {name}-best))",
        f"(= {name}-ties (ties {name}-best))",
        forall({"e": "Value"}, f"(=> (and ({members} e) (holds e)) (shorter {name} {name}-ties (far e) (ties e)))"),
    )


LABELS = Statement(
    (
        sort("Value"),
        SHORTER,
        *(function(name, ["Value"], "Real") for name in ("far", "ties")),
        function("holds", ["Value"], "Bool"),
        *(function(name, ["Value"], "Bool") for name in ("old", "to-via", "from-via", "new")),
        function("both", ["Value", "Value"], "Value"),
        *consts("Real", *(f"{name}{end}" for name in ("direct", "there", "on", "merged") for end in ("", "-ties"))),
        *consts("Value", *(f"{name}-best" for name in ("direct", "there", "on", "merged"))),
    ),
    {
        MERGED: conj(
            forall(
                {"e": "Value", "f": "Value"},
                "(=> (and (to-via e) (from-via f)) (and (= (far (both e f)) (+ (far e) (far f))) "
                "(= (ties (both e f)) (+ (ties e) (ties f))) (= (holds (both e f)) (and (holds e) (holds f)))))",
            ),
            forall(
                {"e": "Value", "f": "Value"},
                "(and (=> (old e) (new e)) (=> (and (to-via e) (from-via f)) (new (both e f))))",
            ),
            forall(
                {"g": "Value"},
                implies(
                    "(new g)",
                    "(or (old g) (exists ((e Value) (f Value)) (and (to-via e) (from-via f) (= g (both e f)))))",
                ),
            ),
        ),
        LEAST: conj(
            _least("direct", "old"), _least("there", "to-via"), _least("on", "from-via"), _least("merged", "new")
        ),
    },
    ite(
        "(shorter direct direct-ties (+ there on) (+ there-ties on-ties))",
        "(and (= merged direct) (= merged-ties direct-ties))",
        "(and (= merged (+ there on)) (= merged-ties (+ there-ties on-ties)))",
    ),
    {"old": "direct", "to the event between": "there", "from it on": "on", "new": "merged"},
)
MINIMUM = "the query of the scenario is the least value whose label it entails"
QUERY = Statement(
    (
        sort("Entry"),
        sort("Environment"),
        function("value", ["Entry"], "Real"),
        function("label", ["Entry"], "Environment"),
        function("entails", ["Environment", "Environment"], "Bool"),
        function("query", ["Environment"], "Real"),
        *consts("Environment", "scenario", "environment"),
        *consts("Entry", "best", "other"),
    ),
    {
        "entailment is reflexive and transitive": conj(
            forall({"a": "Environment"}, "(entails a a)"),
            forall(
                {"a": "Environment", "b": "Environment", "c": "Environment"},
                "(=> (and (entails a b) (entails b c)) (entails a c))",
            ),
        ),
        MINIMUM: conj(
            "(entails scenario (label best))",
            "(= (value best) (query scenario))",
            forall({"a": "Environment", "e": "Entry"}, "(=> (entails a (label e)) (<= (query a) (value e)))"),
        ),
        "the query of the environment is the value of an entry that it entails": conj(
            "(entails environment (label other))", "(= (value other) (query environment))"
        ),
    },
    conj(
        "(=> (< (query scenario) 0.0) (and (entails scenario (label best)) (< (query (label best)) 0.0)))",
        "(=> (and (entails scenario environment) (< (query environment) 0.0)) (< (query scenario) 0.0))",
    ),
    {"query of the scenario": "(query scenario)", "of the environment": "(query environment)"},
)
DOMINATED = (
    "the pair that was dropped is dominated by one that is kept: its label entails the other's, which is tighter"
)
DROP = Statement(
    (*consts("Bool", "kept-label", "dropped-label"), *consts("Real", "kept", "dropped", "t")),
    {DOMINATED: "(and (=> dropped-label kept-label) (< kept dropped))", "what is kept": "(=> kept-label (< t kept))"},
    "(=> dropped-label (< t dropped))",
    {"kept value": "kept", "dropped value": "dropped", "t": "t"},
)


# -- one scenario: constraints as bounds, the loop, and a schedule ----------------------------------------------------
NETWORK: tuple[Command, ...] = (
    *EXECUTIONS,
    function("bound", ["Extended", "Event", "Event"], "Real"),
    function("strict", ["Extended", "Event", "Event"], "Bool"),
    function("far", ["Extended", "Int", "Event", "Event"], "Real"),
    function("ties", ["Extended", "Int", "Event", "Event"], "Real"),
    function("at", ["Int"], "Event"),
    function("turn", ["Event"], "Int"),
    const("rounds", "Int"),
    SHORTER,
    define(
        "within",
        {**EXTENDED_RUN, **PAIR},
        "Bool",
        "(ite (strict s i j) (< (- (time r j) (time r i)) (bound s i j)) (<= (- (time r j) (time r i)) (bound s i j)))",
    ),
    define("consistent", EXTENDED_RUN, "Bool", forall(PAIR, "(=> (distinct i j) (within s r i j))")),
    define(
        "conflict-free",
        {"s": "Extended"},
        "Bool",
        forall({"i": "Event"}, "(shorter 0.0 0.0 (far s rounds i i) (ties s rounds i i))"),
    ),
    define(
        "implied",
        {"s": "Extended", "n": "Int"},
        "Bool",
        forall(
            {"r": "Schedule", **PAIR},
            "(=> (consistent s r) (shorter (- (time r j) (time r i)) 0.0 (far s n i j) (ties s n i j)))",
        ),
    ),
    define(
        "shortest",
        {"s": "Extended", "n": "Int"},
        "Bool",
        implies(
            forall({"i": "Event"}, "(shorter 0.0 0.0 (far s n i i) (ties s n i i))"),
            conj(
                forall(
                    {**PAIR, "k": "Event"},
                    implies(
                        "(< (turn k) n)",
                        "(shorter (far s n i j) (ties s n i j) "
                        "(+ (far s n i k) (far s n k j)) (+ (ties s n i k) (ties s n k j)))",
                    ),
                ),
                forall(PAIR, "(shorter (far s n i j) (ties s n i j) (far s 0 i j) (ties s 0 i j))"),
            ),
        ),
    ),
    *consts("Extended", "s"),
    *consts("Int", "n"),
    *consts("Event", "source", "one", "two"),
    const("run", "Schedule"),
)
"""Of each scenario: bounds from event to event, distances after each round, and what is said of these.

`implied` says that every consistent schedule keeps to the distances, `shortest` that no detour over events that have
had their turn is shorter, nor the bounds themselves, unless some event has a negative distance to itself.
"""
START = "before the first round, distances are the bounds, and zero from an event to itself"
ROUND = "a round: each distance becomes that over the event of the round, if that is shorter"
TURNS = "rounds are counted from zero, and each event has its turn"
NEWEST = "the only event that has its turn in a round is the one of that round"
_OLD = ("(far s n i j)", "(ties s n i j)")
_NEW = ("(far s (+ n 1) i j)", "(ties s (+ n 1) i j)")
_DETOUR = ("(+ (far s n i (at n)) (far s n (at n) j))", "(+ (ties s n i (at n)) (ties s n (at n) j))")


_STAYS = f"(shorter {' '.join(_OLD)} {' '.join(_DETOUR)})"


def _round(stays: Term = _STAYS) -> Term:
    """The round with number n; `stays` says when the old distance does."""
    become = [conj(*(f"(= {new} {old})" for new, old in zip(_NEW, values, strict=True))) for values in (_OLD, _DETOUR)]
    return forall(PAIR, ite(stays, *become))


BASE = {
    START: forall(
        PAIR,
        "(and (= (far s 0 i j) (ite (= i j) 0.0 (bound s i j))) "
        "(= (ties s 0 i j) (ite (and (distinct i j) (strict s i j)) (- 1.0) 0.0)))",
    ),
    TURNS: forall({"i": "Event"}, "(and (<= 0 (turn i)) (< (turn i) rounds))"),
}
STEP = {ROUND: _round(), NEWEST: forall({"k": "Event"}, "(=> (< (turn k) (+ n 1)) (or (< (turn k) n) (= k (at n))))")}
SHOW = {
    "bound from the one to the other": "(bound s one two)",
    "strict": "(strict s one two)",
    "bound back": "(bound s two one)",
    "first event at": "(time run one)",
    "second at": "(time run two)",
}
IMPLIED_START = Statement(NETWORK, BASE, "(implied s 0)", SHOW)
IMPLIED_STEP = Statement(NETWORK, {**STEP, "it holds before the round": "(implied s n)"}, "(implied s (+ n 1))", SHOW)
SHORTEST_START = Statement(NETWORK, BASE, "(shortest s 0)", SHOW)
SHORTEST_STEP = Statement(
    NETWORK, {**STEP, "it holds before the round": "(shortest s n)"}, "(shortest s (+ n 1))", SHOW
)

NO_CONFLICT = Result(
    "pike_theorem_4_1",
    "conflicts are sound",
    "Theorem 4.1: with a temporal conflict there is no consistent schedule",
    forall(EXTENDED_RUN, "(=> (consistent s r) (conflict-free s))"),
)
SCHEDULE = Result(
    "pike_theorem_4_1",
    "conflicts are complete",
    "Theorem 4.1: without a temporal conflict there is a consistent schedule",
    forall({"s": "Extended"}, "(=> (conflict-free s) (consistent s (schedule s)))"),
)
AFTER_IMPLIED = "after the last round, consistent schedules keep to the distances (by induction over rounds)"
AFTER_SHORTEST = "after the last round, the distances are shortest (by induction over rounds)"
DATES = "the schedule has each event at its distance from one of them, moved back a little for each strict bound"
LITTLE = "the moves are ordered as the numbers of strict bounds, and smaller than all room that bounds leave"
SOUND = Statement(NETWORK, {AFTER_IMPLIED: forall({"s": "Extended"}, "(implied s rounds)")}, NO_CONFLICT.formula, SHOW)


def _complete(*, moved: str = "(+ (far s rounds source i) (moved s i))") -> Statement:
    def far(event: str) -> Term:
        return f"(far s rounds source {event})"

    def ties(event: str) -> Term:
        return f"(ties s rounds source {event})"

    gap = f"(- {far('j')} {far('i')})"
    return Statement(
        (*NETWORK, function("schedule", ["Extended"], "Schedule"), function("moved", ["Extended", "Event"], "Real")),
        {
            START: forall({"s": "Extended"}, BASE[START]),
            TURNS: BASE[TURNS],
            AFTER_SHORTEST: forall({"s": "Extended"}, "(shortest s rounds)"),
            DATES: forall({"s": "Extended", "i": "Event"}, f"(= (time (schedule s) i) {moved})"),
            LITTLE: forall(
                {"s": "Extended", **PAIR},
                conj(
                    f"(=> (<= {ties('j')} {ties('i')}) (<= (moved s j) (moved s i)))",
                    f"(=> (< {ties('j')} {ties('i')}) (< (moved s j) (moved s i)))",
                    implies(f"(< {gap} (bound s i j))", f"(< (+ {gap} (- (moved s j) (moved s i))) (bound s i j))"),
                ),
            ),
        },
        SCHEDULE.formula,
        {**SHOW, "first event at": "(time (schedule s) one)", "second at": "(time (schedule s) two)"},
    )


COMPLETE = _complete()

# -- constraints as bounds --------------------------------------------------------------------------------------------
TIGHTEST = "the bound from one event to another is the tightest of the constraints between them that are activated"
BOUNDS = Statement(
    (
        *NETWORK,
        sort("Constraint"),
        *(function(name, ["Constraint"], "Event") for name in ("from", "to")),
        function("most", ["Constraint"], "Real"),
        function("less", ["Constraint"], "Bool"),
        function("activated", ["Constraint"], "Bool"),
        function("tightest", ["Event", "Event"], "Constraint"),
        const("some", "Constraint"),
        define(
            "met",
            {"c": "Constraint"},
            "Bool",
            "(ite (less c) (< (- (time run (to c)) (time run (from c))) (most c)) "
            "(<= (- (time run (to c)) (time run (from c))) (most c)))",
        ),
    ),
    {
        "no constraint is from an event to itself": forall({"c": "Constraint"}, "(distinct (from c) (to c))"),
        TIGHTEST: conj(
            forall(
                PAIR,
                "(=> (distinct i j) (let ((c (tightest i j))) (and (activated c) (= (from c) i) (= (to c) j) "
                "(= (most c) (bound s i j)) (= (less c) (strict s i j)))))",
            ),
            forall(
                {"c": "Constraint"},
                implies(
                    "(activated c)",
                    "(shorter (bound s (from c) (to c)) (ite (strict s (from c) (to c)) (- 1.0) 0.0) "
                    "(most c) (ite (less c) (- 1.0) 0.0))",
                ),
            ),
        ),
    },
    iff("(consistent s run)", forall({"c": "Constraint"}, "(=> (activated c) (met c))")),
    {**SHOW, "a constraint": "(most some)", "activated": "(activated some)"},
)

TWO = "two events, two rounds, one scenario, one schedule"
SMALL_PARTS = (
    "(distinct one two)",
    forall({"i": "Event"}, "(or (= i one) (= i two))"),
    forall({"z": "Extended"}, "(= z s)"),
    forall({"r": "Schedule"}, "(= r run)"),
    "(= source one)",
    "(= rounds 2)",
    "(= (turn one) 0)",
    "(= (turn two) 1)",
    "(= (at 0) one)",
    "(= (at 1) two)",
)
SMALL = conj(*SMALL_PARTS)
FIRST = conj(SMALL, "(= n 0)")
SECOND = conj(SMALL, "(= n 1)")
_TIMELESS = conj(*SMALL_PARTS[:4], "(= rounds 2)", "(= n 0)", "(= (at 0) one)")
HAD = conj(*SMALL_PARTS[:4], "(= rounds 0)", "(= (turn one) (- 1))", "(= (turn two) (- 1))")
TOGETHER = conj(_TIMELESS, "(= (turn one) 0)", "(= (turn two) 0)")

THEOREM = Theorem(
    name="pike_theorem_4_1",
    title="Inconsistent subplans are those with a temporal conflict",
    source="[PIKE, Theorem 4.1]",
    words="A candidate subplan φ_S is temporally inconsistent if and only if φ_S entails a temporal conflict: an "
    "environment under which an event has a negative labeled distance to itself. With strict bounds, which the "
    "augmented plan has, zero is negative too if it is a sum with a strict bound.",
    formalisation="For one scenario, the labeled algorithm is the triple loop on the bounds that the scenario "
    "activates. The invariants of the loop hold before the first round, and each round keeps them, whatever the number "
    "of events: consistent schedules keep to the distances, and no detour over events that have had their turn is "
    "shorter. So a negative distance from an event to itself excludes every schedule, and without one the distances "
    "from any event give a schedule. The query of φ_S is negative exactly if φ_S entails an environment with a "
    "negative query; dominated pairs may be dropped.",
    scope=Scope.INDUCTION,
    bound="any number of events, any bounds, strict or not, any labels. " + FINITE,
    formerly="the loop for four events, bounds not strict",
    trusted="The induction over rounds, whose start and step are proved. Finitely many events leave some room, so "
    "that there are moves smaller than it.",
    lemmas=(
        Lemma(
            "labels",
            "For one scenario, a round on labeled values is a round on the least values whose labels hold.",
            LABELS,
            (
                Variant(
                    "sums of values need not be entered.",
                    LABELS.with_changed(MERGED, forall({"g": "Value"}, "(=> (old g) (new g))")),
                ),
                Variant("the distances need not be the least.", LABELS.without(LEAST)),
            ),
            interesting=conj(
                "(distinct direct there on merged)",
                "(distinct direct-best there-best on-best merged-best)",
                forall(
                    {"e": "Value"},
                    "(and (or (= e direct-best) (= e there-best) (= e on-best) (= e merged-best)) "
                    "(= (old e) (= e direct-best)) (= (to-via e) (= e there-best)) (= (from-via e) (= e on-best)))",
                ),
            ),
        ),
        Lemma(
            "conflict",
            "The query of a scenario is negative exactly if the scenario entails an environment with a negative query.",
            QUERY,
            (
                Variant(
                    "queries need not be the least value.",
                    QUERY.with_changed(MINIMUM, "(entails scenario (label best))").with_also(
                        "two entries, two environments",
                        conj(
                            forall({"e": "Entry"}, "(or (= e best) (= e other))"),
                            forall({"a": "Environment"}, "(or (= a scenario) (= a (label best)))"),
                        ),
                    ),
                ),
            ),
            interesting="(< (query scenario) 0.0)",
        ),
        Lemma(
            "dominance",
            "A dominated labeled value says nothing that the dominating one does not.",
            DROP,
            (
                Variant(
                    "the label of the dropped pair need not entail that of the kept one.",
                    DROP.with_changed(DOMINATED, "(< kept dropped)"),
                ),
                Variant("the kept value is looser.", DROP.with_changed(DOMINATED, "(=> dropped-label kept-label)")),
            ),
        ),
        Lemma(
            "bounds",
            "A schedule meets the tightest activated constraint from each event to each if and only if it meets all.",
            BOUNDS,
            (Variant("the bound need not be the tightest.", BOUNDS.without(TIGHTEST).with_also(TWO, SMALL)),),
            interesting=conj(
                SMALL, forall({"c": "Constraint"}, "(or (= c (tightest one two)) (= c (tightest two one)))")
            ),
        ),
        Lemma(
            "implied, start",
            "Before the first round, consistent schedules keep to the distances.",
            IMPLIED_START,
            (Variant("distances are not the bounds.", IMPLIED_START.without(START).with_also(TWO, SMALL)),),
            interesting=SMALL,
        ),
        Lemma(
            "implied, step",
            "Consistent schedules keep to the distances after a round if they did before.",
            IMPLIED_STEP,
            (
                Variant(
                    "detours are taken even though they are no sums of distances.",
                    IMPLIED_STEP.without(ROUND).with_also(TWO, FIRST),
                ),
                Variant(
                    "the invariant does not hold before.",
                    IMPLIED_STEP.without("it holds before the round").with_also(TWO, FIRST),
                ),
            ),
            interesting=conj(FIRST, "(consistent s run)"),
        ),
        Lemma(
            "shortest, start",
            "Before the first round, no event has had its turn, so no detour counts.",
            SHORTEST_START,
            (Variant("an event may have had its turn.", SHORTEST_START.without(TURNS).with_also("two events", HAD)),),
            interesting=SMALL,
        ),
        Lemma(
            "shortest, step",
            "A round adds the detours over its event to those that are not shorter.",
            SHORTEST_STEP,
            (
                Variant(
                    "a round changes nothing: one event is never intermediate.",
                    SHORTEST_STEP.with_changed(ROUND, _round("true")).with_also(TWO, FIRST),
                ),
                Variant(
                    "several events have their turn, and one is intermediate.",
                    SHORTEST_STEP.without(NEWEST).with_also("two events, one scenario, one schedule", TOGETHER),
                ),
                Variant(
                    "the invariant does not hold before.",
                    SHORTEST_STEP.without("it holds before the round").with_also("the second round", SECOND),
                ),
            ),
            interesting=FIRST,
        ),
        Lemma(
            "conflicts are sound",
            "A scenario with a consistent schedule has no temporal conflict.",
            SOUND,
            (
                Variant(
                    "consistent schedules need not keep to the distances.",
                    SOUND.without(AFTER_IMPLIED).with_also(TWO, SMALL),
                ),
            ),
            interesting=conj(SMALL, "(consistent s run)"),
        ),
        Lemma(
            "conflicts are complete",
            "A scenario without temporal conflict has a consistent schedule: each event at its distance from one.",
            COMPLETE,
            (
                Variant("the distances are not shortest.", COMPLETE.without(AFTER_SHORTEST).with_also(TWO, SMALL)),
                Variant("the distances ignore a bound.", COMPLETE.without(START).with_also(TWO, SMALL)),
                Variant(
                    "events are not moved: a schedule of distances meets strict bounds with equality.",
                    _complete(moved="(far s rounds source i)").with_also(TWO, SMALL),
                ),
            ),
            interesting=conj(SMALL, "(conflict-free s)", "(strict s one two)"),
        ),
    ),
)
