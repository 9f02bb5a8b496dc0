"""[IRR] Theorem 2: the incremental search terminates; its loop as printed can get stuck."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, consts, disj, ite, le, minus, num, plus, times

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
    consts("Real", PRECISION, "step-1", "step-2", "open-1", "open-2"),
    {
        "the precision and the steps are positive": "(and (< 0.0 precision) (< 0.0 step-1) (< 0.0 step-2))",
        OPEN: "(and (<= 1.0 open-1) (<= 1.0 open-2))",
        SOME_LARGE: "(or (<= (/ precision 2.0) step-1) (<= (/ precision 2.0) step-2))",
    },
    "(or (and (<= (/ precision 2.0) step-1) (< 0.0 open-1)) (and (<= (/ precision 2.0) step-2) (< 0.0 open-2)))",
    {"precision β": PRECISION, "step of γ₁": "step-1", "step of γ₂": "step-2"},
)
PICK_PRINTED = "(or (and (<= precision step-1) (< 0.0 open-1)) (and (<= precision step-2) (< 0.0 open-2)))"

THEOREM = Theorem(
    name="irr_theorem_2",
    title="The incremental search terminates",
    source="[IRR, Theorem 2, Algorithm 1]",
    words="If the robustness envelope is bounded in all dimensions, IRR terminates. With β/2 in line 7 as in line "
    "6; as printed "
    "(line 6: Δ ≥ β/2, line 7: Δ ≥ β) the loop can go on with nothing to pick.",
    formalisation="The state of one parameter is its step Δ, the width of its interval, and how many directions Θ "
    "has; the "
    "other parameters enter as one number, since a turn changes one parameter only. Every turn lowers the measure "
    "Σ 8Δ + 2(extent − width) + β|Θ|, which is never negative, by at least β: so there are at most (first "
    "measure)/β turns.",
    scope=Scope.GENERAL,
    bound="any number of parameters, any envelope, any order of turns.",
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
                    "the loop goes on whatever the steps are: nothing may be left to pick.",
                    PICK.without(SOME_LARGE),
                ),
                Variant("directions are not opened again after a step is halved.", PICK.without(OPEN)),
            ),
            (
                Variant(
                    "line 6 goes on while Δ ≥ β/2, line 7 picks among Δ ≥ β: with β = 1 and all steps at 3/4 the loop "
                    "goes on and the set to pick from is empty. Repair: β/2 in both.",
                    PICK.claiming(PICK_PRINTED).with_also(
                        "β = 1 and steps of 3/4",
                        "(and (= precision 1.0) (= step-1 (/ 3.0 4.0)) (= step-2 (/ 3.0 4.0)))",
                    ),
                ),
            ),
        ),
    ),
)
