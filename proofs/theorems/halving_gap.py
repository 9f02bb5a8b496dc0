"""How far the faces that halving finds can be from the envelope: β with β/2 in both lines, 2β as printed."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import Command, conj, const, consts, define, disj, implies, neg


def upward(name: str) -> tuple[Command, ...]:
    """An arbitrary set of places that has with each place all those farther out: none, or all from some end on."""
    return (
        const(f"{name}-end", "Real"),
        *(const(f"{name}-{flag}", "Bool") for flag in ("somewhere", "at-end")),
        define(
            name,
            {"x": "Real"},
            "Bool",
            f"(and {name}-somewhere (or (< {name}-end x) (and {name}-at-end (= {name}-end x))))",
        ),
    )


SPACE = (
    *upward("blocked"),
    *upward("next-blocked"),
    *consts("Real", "step", "next-step", "face", "next-face"),
    *(const(name, "Bool") for name in ("fresh", "open", "next-open", "next-fresh", "other-open")),
)
GROWS = "boxes only grow, so what blocked a face still does"
LATER = "(=> (and blocked-at-end (= blocked-end next-blocked-end)) next-blocked-at-end)"
INVARIANT = "before: a direction that is not fresh is blocked two steps out; one that is closed, one step out"
TURN = "one turn"


def invariant(blocked: str, step: str, face: str, fresh: str, is_open: str) -> str:
    return conj(
        disj(fresh, f"({blocked} (+ {face} {step} {step}))"),
        implies(neg(is_open), f"({blocked} (+ {face} {step}))"),
        implies(fresh, is_open),
        f"(< 0.0 {step})",
    )


SAME = "(and (= next-step step) (= next-fresh fresh))"
HALVED = "(and (= next-step (/ step 2.0)) next-open (not next-fresh) (= next-face face))"
SUCCEEDS = conj(SAME, "open", "next-open", "(= next-face (+ face step))", "(not (blocked (+ face step)))")
FAILS = conj(
    "(= next-step step)", "open", "(not next-open)", "(not next-fresh)", "(= next-face face)", "(blocked (+ face step))"
)
FAILS_LAST = conj("open", "(not other-open)", HALVED, "(blocked (+ face step))")
OTHER_FAILS_LAST = conj("(not open)", HALVED)
ELSEWHERE = conj(SAME, "(= next-face face)", "(= next-open open)")

STEP = Statement(
    SPACE,
    {
        GROWS: implies("blocked-somewhere", conj("next-blocked-somewhere", "(<= next-blocked-end blocked-end)", LATER)),
        INVARIANT: invariant("blocked", "step", "face", "fresh", "open"),
        TURN: disj(SUCCEEDS, FAILS, FAILS_LAST, OTHER_FAILS_LAST, ELSEWHERE),
    },
    invariant("next-blocked", "next-step", "next-face", "next-fresh", "next-open"),
    {
        "step before": "step",
        "after": "next-step",
        "face before": "face",
        "face after": "next-face",
        "direction open": "open",
        "open after": "next-open",
        "blocked one old step out": "(blocked (+ face step))",
        "blocked two new steps out, after": "(next-blocked (+ next-face next-step next-step))",
    },
)
DONE = "the run is over: the step is less than half the precision"
LAST = Statement(
    (*upward("blocked"), *consts("Real", "step", "face", "precision")),
    {
        "the direction is blocked two steps out (it is not fresh: steps start at the precision or more)": (
            "(blocked (+ face step step))"
        ),
        "the step and the precision are positive": "(and (< 0.0 step) (< 0.0 precision))",
        DONE: "(< step (/ precision 2.0))",
    },
    "(blocked (+ face precision))",
    {"face": "face", "last step": "step", "precision β": "precision"},
)
NUMBERS = "face at 0, β = 1, last step 3/4, and the envelope ends at 5/4"
EXAMPLE = conj(
    "(= face 0.0)",
    "(= precision 1.0)",
    "(= step (/ 3.0 4.0))",
    "(and blocked-somewhere (not blocked-at-end) (= blocked-end (/ 5.0 4.0)))",
)
ENDS = "the envelope ends somewhere"
FROM = "(and blocked-somewhere next-blocked-somewhere (= blocked-end 2.0) (= next-blocked-end 2.0))"

THEOREM = Theorem(
    name="halving_gap",
    title="Faces found by halving are within the precision",
    source="[IRR, §4], ours",
    words="When the incremental search ends, each face is at most β from a place where the box would leave the "
    "envelope. This "
    "needs β/2 in lines 6 and 7 of Algorithm 1: if the search ends when every step is below β (line 7, and the "
    "text), faces "
    "can be nearly 2β away; and a direction may be retried only after both directions of its parameter failed.",
    formalisation="One direction of one parameter: where its face is, the step, whether it is open, whether it is "
    "fresh "
    "(has not failed yet). `blocked x` says that the current box, with this face at x, leaves the envelope. Turns "
    "elsewhere "
    "let the box grow. The invariant is proved to hold after each turn; the last lemma reads the gap off it.",
    scope=Scope.GENERAL,
    bound="any number of parameters, any envelope, any order of turns.",
    lemmas=(
        Lemma(
            "turn",
            "Each turn keeps: not fresh implies blocked two steps out, closed implies blocked one step out.",
            STEP,
            (
                Variant(
                    "the step is halved when the other direction fails, while this one is still open.",
                    STEP.with_changed(TURN, conj("open", "(not (blocked (+ face step)))", HALVED)).with_also(
                        ENDS, FROM
                    ),
                ),
                Variant("boxes may shrink: what blocked a face need not any more.", STEP.without(GROWS)),
            ),
            interesting=FAILS_LAST,
        ),
        Lemma(
            "end",
            "At the end, the face is blocked at most β farther out.",
            LAST,
            (
                Variant(
                    "the direction never failed: nothing is known of it.",
                    LAST.without(
                        "the direction is blocked two steps out (it is not fresh: steps start at the precision or more)"
                    ).with_also("never blocked", "(not blocked-somewhere)"),
                ),
            ),
            (
                Variant(
                    "with line 7 as printed the search ends when steps are below β: with β = 1, a last step of 3/4 "
                    "and an "
                    "envelope that ends at 5/4, the face at 0 is 5/4 > β away. Repair: β/2 in line 7.",
                    LAST.with_changed(DONE, "(< step precision)").with_also(NUMBERS, EXAMPLE),
                ),
            ),
        ),
        Lemma(
            "end as printed",
            "With line 7 as printed the gap is less than 2β.",
            LAST.with_changed(DONE, "(< step precision)").claiming("(blocked (+ face precision precision))"),
            (
                Variant(
                    "steps may end at β and more.",
                    LAST.without(DONE)
                    .claiming("(blocked (+ face precision precision))")
                    .with_also("an envelope that ends at 3", "(and blocked-somewhere (= blocked-end 3.0))"),
                ),
            ),
        ),
    ),
)
