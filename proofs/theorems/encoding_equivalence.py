"""The two encodings agree: truth by the last writer, and truth position by position; sums, and steps."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import (
    conj,
    const,
    consts,
    define,
    disj,
    exists,
    forall,
    function,
    iff,
    implies,
    sort,
)

WRITER = {"w": "Happening"}
TWO = {"a": "Happening", "b": "Happening"}
PLAN = (
    sort("Happening"),
    function("time", ["Happening"], "Real"),
    function("position", ["Happening"], "Int"),
    function("at", ["Int"], "Happening"),
    *(function(name, ["Happening"], "Bool") for name in ("writes", "makes-true")),
    function("state", ["Int"], "Bool"),
    const("initial", "Bool"),
    const("count", "Int"),
    const("place", "Int"),
    *consts("Happening", "reader", "last", "other"),
)
ORDER = "positions follow time; each happening has its own"
FRAME = "frame: the state after a position is what its happening writes, or else as before"
BEFORE_PLACE = "(and (writes w) (< (position w) place))"

HISTORY = disj(
    conj("(= (state place) initial)", forall(WRITER, f"(not {BEFORE_PLACE})")),
    conj(
        "(writes last)",
        "(< (position last) place)",
        "(= (state place) (makes-true last))",
        forall(WRITER, implies(BEFORE_PLACE, "(<= (position w) (position last))")),
    ),
)
NEXT = "(and (writes w) (< (position w) (+ place 1)))"
NEXT_LAST = "(ite (writes (at place)) (at place) last)"
NEXT_HISTORY = disj(
    conj("(= (state (+ place 1)) initial)", forall(WRITER, f"(not {NEXT})")),
    conj(
        f"(writes {NEXT_LAST})",
        f"(< (position {NEXT_LAST}) (+ place 1))",
        f"(= (state (+ place 1)) (makes-true {NEXT_LAST}))",
        forall(WRITER, implies(NEXT, f"(<= (position w) (position {NEXT_LAST}))")),
    ),
)
OCCUPIED = "the place has a happening, and no other happening has this place"
STEP_FRAME = "(= (state (+ place 1)) (ite (writes (at place)) (makes-true (at place)) (state place)))"
SHOW = {
    "place": "place",
    "state there": "(state place)",
    "state after": "(state (+ place 1))",
    "its happening writes": "(writes (at place))",
    "what it writes": "(makes-true (at place))",
}
STEP = Statement(
    PLAN,
    {
        "at this place, the state is what the last writer before it wrote, or the initial one": HISTORY,
        OCCUPIED: conj(
            "(= (position (at place)) place)", forall(WRITER, "(=> (= (position w) place) (= w (at place)))")
        ),
        FRAME: STEP_FRAME,
    },
    NEXT_HISTORY,
    SHOW,
)
START = Statement(
    PLAN,
    {
        "the first place is before every happening": conj("(= place 0)", forall(WRITER, "(<= 0 (position w))")),
        "the state there is the initial one": "(= (state 0) initial)",
    },
    HISTORY,
    SHOW,
)
EARLIER = "(and (writes w) (< (time w) (time reader)))"
LATEST = conj(
    EARLIER,
    "(makes-true w)",
    forall({"v": "Happening"}, "(not (and (writes v) (< (time w) (time v)) (< (time v) (time reader))))"),
)
RELATIONAL = disj(exists(WRITER, LATEST), conj("initial", forall(WRITER, f"(not {EARLIER})")))
READS_APART = "no writer is at the time of the reader (they are separated)"
WRITES_APART = "writers at one time write the same (others are separated)"
HAPPENINGS = "three happenings"
ONLY_THREE = conj("(distinct reader last other)", forall(WRITER, "(or (= w reader) (= w last) (= w other))"))
AGREE = Statement(
    PLAN,
    {
        ORDER: forall(
            TWO,
            "(and (=> (< (time a) (time b)) (< (position a) (position b))) (=> (= (position a) (position b)) (= a b)))",
        ),
        "the place is the reader's; there the state is what the last writer before it wrote, or the initial one": conj(
            "(= place (position reader))", HISTORY
        ),
        READS_APART: forall(WRITER, "(=> (and (writes w) (distinct w reader)) (distinct (time w) (time reader)))"),
        WRITES_APART: forall(
            TWO, "(=> (and (writes a) (writes b) (= (time a) (time b))) (= (makes-true a) (makes-true b)))"
        ),
    },
    iff("(state place)", RELATIONAL),
    {
        "reader at": "(time reader)",
        "last writer by position at": "(time last)",
        "another happening at": "(time other)",
        "state by positions": "(state place)",
        "last writer makes it true": "(makes-true last)",
        "the other writes": "(writes other)",
        "the other makes it true": "(makes-true other)",
    },
)

CLAMP = "(ite (<= t start) 0.0 (ite (<= t end) (- t start) (- end start)))"
FLOW = Statement(
    (*consts("Real", "start", "end", "from", "to"), define("clamped", {"t": "Real"}, "Real", CLAMP)),
    {
        "an action, and a step in time": "(and (< start end) (<= from to))",
        "neither start nor end is strictly inside the step: they are happenings, steps are between neighbours": conj(
            "(or (<= start from) (<= to start))", "(or (<= end from) (<= to end))"
        ),
    },
    "(= (- (clamped to) (clamped from)) (ite (and (<= start from) (<= to end)) (- to from) 0.0))",
    {"action from": "start", "action to": "end", "step from": "from", "step to": "to"},
)
NUMBERS = consts(
    "Real", "before", "sum", "next", "next-sum", "base", "base-sum", "next-base", "next-base-sum", "change"
)
ASSIGN = Statement(
    (*NUMBERS, const("assigns", "Bool")),
    {
        "the value is the last assignment's, with the changes since": "(= before (+ base (- sum base-sum)))",
        "step: an assignment replaces the value, else the change is added": (
            "(= next (ite assigns change (+ before change)))"
        ),
        "the sum of changes grows by each change, and not by assignments": (
            "(= next-sum (ite assigns sum (+ sum change)))"
        ),
        "an assignment is the new base": conj(
            "(= next-base (ite assigns change base))", "(= next-base-sum (ite assigns next-sum base-sum))"
        ),
    },
    "(= next (+ next-base (- next-sum next-base-sum)))",
    {"value before": "before", "after": "next", "assignment": "assigns", "change": "change"},
)

THEOREM = Theorem(
    name="encoding_equivalence",
    title="Both encodings describe the same states",
    source="ours",
    words="For schedules that keep the separations, the state before a time point is the same in both encodings, "
    "whatever "
    "order the positions give to happenings at one time: an atom is as the last writer before it made it, or as it "
    "was at "
    "first; a numeric fluent is its last assignment (or initial value) with the sum of the discrete changes and "
    "the clamped "
    "continuous changes since.",
    formalisation="Atoms: induction over positions of the frame axiom, then the last writer by position against "
    "the last by "
    "time. Numbers: one step of the sums; a continuous change is rate·clamp(t − start, 0, end − start), of which a "
    "step "
    "between neighbours adds rate·(its length) during the action and nothing outside (the rate is a common factor).",
    scope=Scope.GENERAL,
    bound="any number of happenings, writers and positions.",
    trusted="The induction over positions: start and step are proved. Sums over effects are sums of what each "
    "contributes.",
    lemmas=(
        Lemma(
            "start",
            "At the first place the state is the initial one.",
            START,
            (
                Variant(
                    "the state at the first place is not the initial one.",
                    START.without("the state there is the initial one").with_also(HAPPENINGS, ONLY_THREE),
                ),
            ),
        ),
        Lemma(
            "step",
            "If the state at a place is what the last writer before it wrote, so it is at the next.",
            STEP,
            (
                Variant("there are no frame axioms.", STEP.without(FRAME).with_also(HAPPENINGS, ONLY_THREE)),
                Variant(
                    "two happenings may have one place: the frame axiom speaks of one of them.",
                    STEP.with_changed(OCCUPIED, "(= (position (at place)) place)").with_also(HAPPENINGS, ONLY_THREE),
                ),
            ),
            interesting="(and (writes last) (writes (at place)) (< (position last) place))",
        ),
        Lemma(
            "atoms",
            "At a reader's place, the last writer by position and the last by time give the same.",
            AGREE,
            (
                Variant(
                    "a writer may be at the time of the reader: its position decides, its time does not.",
                    AGREE.without(READS_APART).with_also(HAPPENINGS, ONLY_THREE),
                ),
                Variant(
                    "writers at one time may write differently.",
                    AGREE.without(WRITES_APART).with_also(HAPPENINGS, ONLY_THREE),
                ),
                Variant("positions need not follow time.", AGREE.without(ORDER).with_also(HAPPENINGS, ONLY_THREE)),
            ),
            interesting="(and (writes last) (writes other) (< (time other) (time last)) (< (time last) (time reader)))",
        ),
        Lemma(
            "continuous change",
            "Between neighbours, a continuous change adds its rate times the length of the step while the action runs.",
            FLOW,
            (
                Variant(
                    "the action may start or end inside the step.",
                    FLOW.without(
                        "neither start nor end is strictly inside the step: they are happenings, steps are between "
                        "neighbours"
                    ),
                ),
            ),
        ),
        Lemma(
            "assignment",
            "Value by value or as the last assignment with the changes since: one step keeps both equal.",
            ASSIGN,
            (
                Variant(
                    "the sum since the last assignment is not started again.",
                    ASSIGN.with_changed("an assignment is the new base", "(= next-base (ite assigns change base))"),
                ),
            ),
        ),
    ),
)
