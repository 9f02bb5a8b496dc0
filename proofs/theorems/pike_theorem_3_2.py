"""[PIKE] Theorem 3.2: the constraints required to execute an event now."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.network import FINITE, NETWORK, SHORTEST, TRIANGLE, only
from proofs.theorems._library.terms import conj, const, consts, define, forall, function, implies

EVENT = {"i": "Event"}
PAIR = {"i": "Event", "j": "Event"}
DECLARED = (
    *NETWORK,
    function("past", ["Event"], "Bool"),
    function("direct", ["Event"], "Bool"),
    function("time", ["Event"], "Real"),
    const("event", "Event"),
    const("now", "Real"),
    define("fixed", EVENT, "Bool", "(or (past i) (= i event))"),
    define("at", EVENT, "Real", "(ite (= i event) now (time i))"),
)
SO_FAR = "the executed events agree with the scenario's distances"
WINDOWS = (
    "no event that remains has missed its window: what was executed leaves it the present time, or later if it is "
    "not ours"
)
DIRECT = "the event is directly executable, and not executed yet (constraint 2)"
LOWER = "constraint 3: no lower bound from executed events is after the present time"
UPPER = "constraint 4: no upper bound from executed events is before the present time"
ORDER = "constraint 5: no event that remains must come before this one"
EXTERNAL = "constraint 6: none that remains and is not directly executable must come before it or at once"
REMAINS = "(and (not (past i)) (distinct i event))"
BEFORE = {
    **SHORTEST,
    SO_FAR: forall(PAIR, "(=> (and (past i) (past j)) (<= (- (time j) (time i)) (d i j)))"),
    "executed events are not later than the present time": forall(EVENT, "(=> (past i) (<= (time i) now))"),
    WINDOWS: forall(
        {"i": "Event", "x": "Event"},
        implies(
            conj(REMAINS, "(past x)"), "(ite (direct i) (<= now (+ (time x) (d x i))) (< now (+ (time x) (d x i))))"
        ),
    ),
    DIRECT: "(and (not (past event)) (direct event))",
}
REQUIRED = {
    LOWER: forall({"x": "Event"}, "(=> (past x) (<= (- (time x) (d event x)) now))"),
    UPPER: forall({"x": "Event"}, "(=> (past x) (<= now (+ (time x) (d x event))))"),
    ORDER: forall(EVENT, implies(REMAINS, "(<= 0.0 (d event i))")),
    EXTERNAL: forall(EVENT, implies(conj(REMAINS, "(not (direct i))"), "(< 0.0 (d event i))")),
}
LATEST = "each event is as late as the fixed ones allow: `by` is one that allows the least"
GIVEN = {
    LATEST: forall(
        EVENT,
        conj(
            "(fixed (by i))",
            "(= (latest i) (+ (at (by i)) (d (by i) i)))",
            forall({"x": "Event"}, "(=> (fixed x) (<= (latest i) (+ (at x) (d x i))))"),
        ),
    )
}
SHOW = {
    "present time": "now",
    "an executed event at": "(time done)",
    "another event, at the latest at": "(latest other)",
    "another event directly executable": "(direct other)",
    "from this event to the other at most": "(d event other)",
    "from the executed event to this one at most": "(d done event)",
    "from this one to the executed one at most": "(d event done)",
}
CONSISTENT = "(<= (- (latest other) (latest done)) (d done other))"
SUFFICIENT = Statement(
    (
        *DECLARED,
        function("by", ["Event"], "Event"),
        function("latest", ["Event"], "Real"),
        *consts("Event", "done", "other"),
    ),
    {**BEFORE, **REQUIRED, **GIVEN},
    conj(
        CONSISTENT,
        "(= (latest event) now)",
        "(=> (past done) (= (latest done) (time done)))",
        "(=> (and (not (past other)) (distinct other event)) (ite (direct other) (<= now (latest other)) (< now "
        "(latest other))))",
    ),
    SHOW,
)
THREE = "three events"
WORLD = only("event", "done", "other")
PRESENT = conj(WORLD, "(past done)", "(not (past other))")

SCHEDULE = "the schedule is consistent with the scenario"
FUTURE = "events that remain are not before the present time, and after it if they are not directly executable"
AGREES = "it has the executed events at their times, and the event at the present time"
NECESSARY = Statement(
    (*DECLARED, function("plan", ["Event"], "Real"), *consts("Event", "done", "other")),
    {
        DIRECT: BEFORE[DIRECT],
        SCHEDULE: forall(PAIR, "(<= (- (plan j) (plan i)) (d i j))"),
        AGREES: conj("(= (plan event) now)", forall(EVENT, "(=> (past i) (= (plan i) (time i)))")),
        FUTURE: forall(EVENT, implies(REMAINS, "(ite (direct i) (<= now (plan i)) (< now (plan i)))")),
    },
    conj(
        "(=> (past done) (and (<= (- (time done) (d event done)) now) (<= now (+ (time done) (d done event)))))",
        implies(
            "(and (not (past other)) (distinct other event))",
            "(and (<= 0.0 (d event other)) (=> (not (direct other)) (< 0.0 (d event other))))",
        ),
    ),
    {**{k: v for k, v in SHOW.items() if "latest" not in v}, "the other event planned at": "(plan other)"},
)


def dropped(words: str, assumption: str) -> Variant:
    return Variant(words, SUFFICIENT.without(assumption).with_also(THREE, PRESENT))


THEOREM = Theorem(
    name="pike_theorem_3_2",
    title="The constraints required to execute an event",
    source="[PIKE, Theorem 3.2]",
    words="Let the executed events agree with a scenario φ_S, let no remaining event have missed its window, and "
    "let the event be "
    "directly executable. Then φ_S satisfies the required constraints at time t if and only if φ_S has a "
    "consistent schedule "
    "with the executed events at their times, the event at t, and everything else from now on (later than now what "
    "is not "
    "directly executable). As printed, without these provisos, neither direction holds.",
    formalisation="One scenario with its shortest distances. `past` are the executed events, `direct` those that "
    "the executive "
    "may execute. The schedule is given: each event as late as fixed ones allow.",
    scope=Scope.GENERAL,
    bound="any number of events, any distances. " + FINITE,
    trusted="For one scenario, a constraint ¬φ per labeled value says that no value whose label holds is violated, "
    "so the "
    "query counts. Finitely many fixed events have one that allows the least time.",
    lemmas=(
        Lemma(
            "sufficient",
            "If the constraints hold, the schedule in which each event is as late as allowed is consistent and "
            "lies ahead.",
            SUFFICIENT,
            (
                dropped("constraint 3 is left out.", LOWER),
                dropped("constraint 4 is left out.", UPPER),
                dropped("constraint 5 is left out.", ORDER),
                dropped("constraint 6 is left out.", EXTERNAL),
                Variant(
                    "the distances are not shortest.",
                    SUFFICIENT.without(TRIANGLE).with_also(
                        "three events, two of which remain", conj(WORLD, "(not (past done))", "(not (past other))")
                    ),
                ),
            ),
            (
                Variant(
                    '"let the partial execution be temporally consistent" does not say with which scenario: two '
                    "executed "
                    "events may agree with another scenario than φ_S, and the constraints do not look at them again. "
                    "Repair: they agree with φ_S (the theory has the constraints that were committed for them).",
                    SUFFICIENT.without(SO_FAR).with_also(THREE, conj(WORLD, "(past done)", "(past other)")),
                ),
                Variant(
                    "another event may have missed its window: the constraints are about the event to be executed "
                    "only. "
                    "Repair: missed windows are processed before (line 6 of Algorithm 1).",
                    SUFFICIENT.without(WINDOWS).with_also(THREE, PRESENT),
                ),
            ),
            interesting=PRESENT,
        ),
        Lemma(
            "necessary",
            "If such a schedule exists, the constraints hold.",
            NECESSARY,
            (
                Variant(
                    "the schedule is not consistent with the scenario.",
                    NECESSARY.without(SCHEDULE).with_also(THREE, PRESENT),
                ),
                Variant(
                    "the executed events are elsewhere in the schedule.",
                    NECESSARY.without(AGREES).with_also(THREE, PRESENT),
                ),
            ),
            (
                Variant(
                    "Definition 2.7 lets an extension put a remaining event before the present time. Then such a "
                    "schedule "
                    "exists where constraint 5 fails: the other event must come 1 before this one, and was not "
                    "executed. Repair: remaining events are not in the past.",
                    NECESSARY.without(FUTURE)
                    .with_also(THREE, PRESENT)
                    .with_also("the other must be 1 before", "(and (= (d event other) (- 1.0)) (= now 5.0))"),
                ),
                Variant(
                    "constraint 2 is false for an event that the executive may not execute itself, though a consistent "
                    "schedule with this event at the present time may exist. Repair: the event is directly executable.",
                    NECESSARY.without(DIRECT)
                    .claiming("(and (not (past event)) (direct event))")
                    .with_also(THREE, conj(PRESENT, "(not (past event))")),
                ),
            ),
            interesting=PRESENT,
        ),
    ),
)
