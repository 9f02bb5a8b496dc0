"""[IRR] Theorem 2: the incremental search terminates; its loop as printed can get stuck."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import (
    conj,
    consts,
    disj,
    exists,
    forall,
    function,
    implies,
    ite,
    le,
    minus,
    num,
    plus,
    sort,
    times,
)

STEP, NEXT_STEP, PRECISION = "step", "next-step", "precision"
BOUNDED = "the envelope is bounded: a box inside it is at most `extent` wide"
PICKED = "a parameter is picked while its step is at least half the precision"
OPEN_MEASURE = ite("(= open 1.0)", PRECISION, plus(PRECISION, PRECISION))
NEXT_OPEN_MEASURE = ite("(= next-open 1.0)", PRECISION, plus(PRECISION, PRECISION))


def measure(step: str, width: str, directions: str) -> str:
    return plus(times(num(8), step), times(num(2), minus("extent", width)), directions, "others")


BEFORE = measure(STEP, "width", OPEN_MEASURE)
AFTER = measure(NEXT_STEP, "next-width", NEXT_OPEN_MEASURE)
WIDENED = conj("(= next-width (+ width step))", "(= next-step step)", "(= next-open open)")
FAILED_ONCE = conj("(= next-width width)", "(= next-step step)", "(= open 2.0)", "(= next-open 1.0)")
FAILED_TWICE = conj("(= next-width width)", "(= next-step (/ step 2.0))", "(= open 1.0)", "(= next-open 2.0)")
SHRUNK = conj("(= next-width width)", "(= next-step step)", "(= open 1.0)", "(= next-open 2.0)")

INVARIANT = "the invariant holds before: step positive, one or two directions open, width within the envelope's extent"
TURN = "one turn: the box grows by the step, or one of two directions closes, or the step is halved and both open"
INSIDE = "a box that is kept is inside the envelope, so not wider than its extent"
NEXT_INVARIANT = conj("(< 0.0 next-step)", disj("(= next-open 1.0)", "(= next-open 2.0)"), "(<= next-width extent)")
SHOW = {
    "precision β": PRECISION,
    "step Δ before": STEP,
    "step after": NEXT_STEP,
    "width before": "width",
    "width after": "next-width",
    "open directions before": "open",
    "after": "next-open",
    "extent of the envelope": "extent",
}
TURNS = Statement(
    consts("Real", PRECISION, STEP, NEXT_STEP, "width", "next-width", "extent", "open", "next-open", "others"),
    {
        "the precision is positive, what other parameters contribute is not "
        "negative": "(and (< 0.0 precision) (<= 0.0 others))",
        INVARIANT: conj("(< 0.0 step)", disj("(= open 1.0)", "(= open 2.0)"), "(<= 0.0 width)", "(<= width extent)"),
        PICKED: "(<= (/ precision 2.0) step)",
        TURN: disj(WIDENED, FAILED_ONCE, FAILED_TWICE),
        INSIDE: "(<= next-width extent)",
    },
    conj(NEXT_INVARIANT, le("precision", minus(BEFORE, AFTER)), le(num(0), AFTER)),
    SHOW,
)

SOME_LARGE = "the loop goes on: some step is at least half the precision"
OPEN = "each parameter has a direction open"
PICK = Statement(
    (
        sort("Parameter"),
        *consts("Real", PRECISION),
        *(function(name, ["Parameter"], "Real") for name in ("step", "open")),
        *consts("Parameter", "one", "two"),
    ),
    {
        "the precision and the steps are positive": conj(
            "(< 0.0 precision)", forall({"p": "Parameter"}, "(< 0.0 (step p))")
        ),
        OPEN: forall({"p": "Parameter"}, "(<= 1.0 (open p))"),
        SOME_LARGE: exists({"p": "Parameter"}, "(<= (/ precision 2.0) (step p))"),
    },
    exists({"p": "Parameter"}, "(and (<= (/ precision 2.0) (step p)) (< 0.0 (open p)))"),
    {"precision β": PRECISION, "step of γ₁": "(step one)", "step of γ₂": "(step two)"},
)
PICK_PRINTED = exists({"p": "Parameter"}, "(and (<= precision (step p)) (< 0.0 (open p)))")

# -- the sum over all parameters --------------------------------------------------------------------------------------
OTHERS = "a turn changes what one parameter contributes, and nothing else"
SUMS = "the measure is the sum of what the parameters contribute, added one after the other"
CHANGE = "(- (after g) (before g))"
SUM = Statement(
    (
        *(function(name, ["Int"], "Real") for name in ("before", "after", "sum-before", "sum-after")),
        *consts("Int", "g", "k"),
    ),
    {
        OTHERS: forall({"p": "Int"}, "(=> (distinct p g) (= (after p) (before p)))"),
        SUMS: conj(
            "(= (sum-before (+ k 1)) (+ (sum-before k) (before k)))",
            "(= (sum-after (+ k 1)) (+ (sum-after k) (after k)))",
        ),
        "of the first parameters, the picked one among them or not, the sum has changed as much": (
            f"(= (- (sum-after k) (sum-before k)) (ite (< g k) {CHANGE} 0.0))"
        ),
    },
    f"(= (- (sum-after (+ k 1)) (sum-before (+ k 1))) (ite (< g (+ k 1)) {CHANGE} 0.0))",
    {"sum before": "(sum-before (+ k 1))", "sum after": "(sum-after (+ k 1))"},
)

# -- termination ------------------------------------------------------------------------------------------------------
POSITIVE = "the measure is never negative"
SO_MANY = "as long as the loop goes on, the measure is at most the first less a β for each turn"
COUNT = Statement(
    consts("Real", "measure", "next-measure", "first", "turns"),
    {
        "a turn lowers the measure, counted in β, by one at least": "(<= next-measure (- measure 1.0))",
        SO_MANY: "(<= measure (- first turns))",
    },
    "(<= next-measure (- first (+ turns 1.0)))",
    {"measure": "measure", "after": "next-measure", "turns": "turns"},
)
ENDS = Statement(
    (function("measure", ["Int"], "Real"), function("goes-on", ["Int"], "Bool"), *consts("Int", "enough")),
    {
        POSITIVE: forall({"n": "Int"}, "(=> (<= 0 n) (<= 0.0 (measure n)))"),
        f"{SO_MANY} (by induction over turns, lemma count)": implies(
            forall({"m": "Int"}, "(=> (and (<= 0 m) (<= m enough)) (goes-on m))"),
            "(<= (measure enough) (- (measure 0) (to_real enough)))",
        ),
        "more turns than the first measure in β": "(and (<= 0 enough) (< (measure 0) (to_real enough)))",
    },
    exists({"m": "Int"}, "(and (<= 0 m) (<= m enough) (not (goes-on m)))"),
    {"first measure": "(measure 0)", "turns": "enough", "measure then": "(measure enough)"},
)

FEW_TURNS = "a run"
NEVER = "(and (= enough 3) (= (measure 0) 2.0) (goes-on 0) (goes-on 1) (goes-on 2) (goes-on 3) (not (goes-on 4)))"

THEOREM = Theorem(
    name="irr_theorem_2",
    title="The incremental search terminates",
    source="[IRR, Theorem 2, Algorithm 1]",
    words="If the robustness envelope is bounded in all dimensions, IRR terminates. With β/2 in line 7 as in line "
    "6; as printed "
    "(line 6: Δ ≥ β/2, line 7: Δ ≥ β) the loop can go on with nothing to pick.",
    formalisation="The state of one parameter is its step Δ, the width of its interval, and how many directions Θ "
    "has. Every turn lowers the measure Σ 8Δ + 2(extent − width) + β|Θ|, which is never negative, by at least β: a "
    "ranking function. That the loop ends is the last claim: among more turns than the first measure has β, there is "
    "one at which it does not go on.",
    scope=Scope.INDUCTION,
    bound="any number of parameters, any envelope, any order of turns.",
    formerly="the choice of a parameter for two parameters; that the loop ends was concluded in words",
    trusted="The inductions over parameters and over turns, whose steps are proved; both begin with zero, for a sum "
    "over no parameter and after no turn.",
    lemmas=(
        Lemma(
            "turn",
            "A turn keeps the invariant and lowers the measure by β at least; the measure is never negative.",
            TURNS,
            (
                Variant(
                    "the envelope is not bounded: the measure falls below zero, and the box may grow for ever.",
                    TURNS.without(INSIDE),
                ),
                Variant(
                    "parameters are picked whatever their step is: turns of ever smaller steps lower the measure "
                    "too little.",
                    TURNS.with_changed(PICKED, "(< 0.0 step)"),
                ),
                Variant(
                    "the step is not halved after both directions failed: the measure rises.",
                    TURNS.with_changed(TURN, disj(WIDENED, FAILED_ONCE, SHRUNK)),
                ),
            ),
            interesting=FAILED_TWICE,
        ),
        Lemma(
            "start",
            "The invariant holds at the start: a point, Δ = max(π·ω, β), both directions open.",
            START := Statement(
                consts("Real", PRECISION, "scaled", STEP, "width", "extent"),
                {
                    "the precision is positive": "(< 0.0 precision)",
                    "the first step is the larger of the scaled value and the "
                    "precision": "(= step (ite (<= scaled precision) precision scaled))",
                    "the first box is a point; the extent is not negative": "(and (= width 0.0) (<= 0.0 extent))",
                },
                conj("(< 0.0 step)", "(<= precision step)", "(<= 0.0 width)", "(<= width extent)"),
                {"π·ω": "scaled", "β": PRECISION, "step": STEP},
            ),
            (
                Variant(
                    "the first step is π·ω: for a nominal value of zero it is zero, and no turn changes anything.",
                    START.with_changed(
                        "the first step is the larger of the scaled value and the precision", "(= step scaled)"
                    ).with_also("nominal value zero", "(= scaled 0.0)"),
                ),
            ),
        ),
        Lemma(
            "progress",
            "While the loop goes on, there is a parameter to pick (the invariant gives it an open direction).",
            PICK,
            (
                Variant(
                    "the loop goes on whatever the steps are: nothing may be left to pick.", PICK.without(SOME_LARGE)
                ),
                Variant("directions are not opened again after a step is halved.", PICK.without(OPEN)),
            ),
            (
                Variant(
                    "line 6 goes on while Δ ≥ β/2, line 7 picks among Δ ≥ β: with β = 1 and all steps at 3/4 the loop "
                    "goes on and the set to pick from is empty. Repair: β/2 in both.",
                    PICK.claiming(PICK_PRINTED).with_also(
                        "β = 1 and steps of 3/4",
                        conj(
                            "(= precision 1.0)",
                            forall({"p": "Parameter"}, "(and (or (= p one) (= p two)) (= (step p) (/ 3.0 4.0)))"),
                        ),
                    ),
                ),
            ),
        ),
        Lemma(
            "sum",
            "If one parameter changes, the sum over all changes as much.",
            SUM,
            (Variant("other parameters may change, too.", SUM.without(OTHERS)),),
            interesting="(and (< 0 g) (= g k))",
        ),
        Lemma(
            "count",
            "A turn more lowers the measure, counted in β, by one more.",
            COUNT,
            (
                Variant(
                    "a turn need not lower the measure.",
                    COUNT.without("a turn lowers the measure, counted in β, by one at least"),
                ),
            ),
        ),
        Lemma(
            "end",
            "Among more turns than the first measure has β, there is one at which the loop does not go on.",
            ENDS,
            (
                Variant("the measure may fall below zero.", ENDS.without(POSITIVE).with_also(FEW_TURNS, NEVER)),
                Variant(
                    "turns need not lower the measure.",
                    ENDS.without(f"{SO_MANY} (by induction over turns, lemma count)").with_also(FEW_TURNS, NEVER),
                ),
                Variant(
                    "there may be fewer turns.",
                    ENDS.without("more turns than the first measure in β").with_also(
                        FEW_TURNS, "(and (= enough 1) (= (measure 0) 2.0) (goes-on 0) (goes-on 1) (not (goes-on 2)))"
                    ),
                ),
            ),
            interesting="(and (= enough 3) (= (measure 0) 2.0) (goes-on 0) (not (goes-on 1)))",
        ),
    ),
)
