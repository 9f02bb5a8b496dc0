"""[PIKE] Theorem 3.1: the reduction of Appendix B is correct; what else makes the problem NP-complete is in words."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import conj, const, consts, exists, forall, function, iff, implies, sort

BOTH = {"c": "Clause", "v": "Variable"}
ENDS = conj("(holds v)", "(< (end-true v) (start clause))")
ENDS_FALSE = conj("(not (holds v))", "(< (end-false v) (start clause))")
SUPPORTED = exists(
    {"v": "Variable"}, (f"(or (and (adds-true v clause) {ENDS}) (and (adds-false v clause) {ENDS_FALSE}))")
)
SATISFIED = exists(
    {"v": "Variable"}, "(or (and (positive clause v) (holds v)) (and (negative clause v) (not (holds v))))"
)
EFFECTS = "(assign-xᵢ) adds (clause-holds c) if xᵢ is in c, (assign-not-xᵢ) if ¬xᵢ is; nothing deletes it"
AFTER = "clause activities start after the activated assignments end"
FORMULA = (
    sort("Variable"),
    sort("Clause"),
    *(function(name, ["Clause", "Variable"], "Bool") for name in ("positive", "negative")),
    *(function(name, ["Variable", "Clause"], "Bool") for name in ("adds-true", "adds-false")),
    function("holds", ["Variable"], "Bool"),
)
TIMES = tuple(
    function(name, [kind], "Real")
    for name, kind in (
        ("begin-true", "Variable"),
        ("end-true", "Variable"),
        ("begin-false", "Variable"),
        ("end-false", "Variable"),
        ("start", "Clause"),
        ("end", "Clause"),
    )
)
ORDERED = conj(
    implies("(holds v)", "(and (<= (+ (begin-true v) epsilon) (end-true v)) (<= (+ (end-true v) epsilon) (start c)))"),
    implies(
        "(not (holds v))",
        "(and (<= (+ (begin-false v) epsilon) (end-false v)) (<= (+ (end-false v) epsilon) (start c)))",
    ),
    "(<= (+ (start c) epsilon) (end c))",
)
REDUCTION = Statement(
    (*FORMULA, *TIMES, *consts("Real", "epsilon"), const("clause", "Clause"), const("some", "Variable")),
    {
        EFFECTS: forall(BOTH, "(and (= (adds-true v c) (positive c v)) (= (adds-false v c) (negative c v)))"),
        AFTER: forall(BOTH, ORDERED),
        "ε is positive": "(< 0.0 epsilon)",
    },
    iff(SUPPORTED, SATISFIED),
    {
        "variable holds": "(holds some)",
        "in the clause": "(positive clause some)",
        "negated in the clause": "(negative clause some)",
        "(assign-x) ends": "(end-true some)",
        "(assign-not-x) ends": "(end-false some)",
        "clause activity starts": "(start clause)",
    },
)
SMALL = "one variable and one clause"
ONE = forall(BOTH, "(and (= v some) (= c clause))")
DATES = "assignments from 0 to ε, clause activities from 2ε to 3ε"
EXISTS = Statement(
    (*FORMULA, *TIMES, *consts("Real", "epsilon"), const("clause", "Clause"), const("some", "Variable")),
    {
        DATES: forall(
            BOTH,
            conj(
                "(= (begin-true v) 0.0)",
                "(= (begin-false v) 0.0)",
                "(= (end-true v) epsilon)",
                "(= (end-false v) epsilon)",
                "(= (start c) (+ epsilon epsilon))",
                "(= (end c) (+ epsilon epsilon epsilon))",
            ),
        ),
        "ε is positive": "(< 0.0 epsilon)",
    },
    forall(BOTH, ORDERED),
    {"ε": "epsilon"},
)

THEOREM = Theorem(
    name="pike_theorem_3_1",
    title="Satisfiability reduces to checking for a correct execution",
    source="[PIKE, Theorem 3.1, Appendix B]",
    words="The plan that Appendix B makes of a formula in conjunctive normal form has a correct execution if and only "
    "if the formula is satisfiable; models and scenarios with a correct execution are the same. This is the step of "
    "the proof of NP-completeness that is about plans; the others are in words below.",
    formalisation="`Variable` and `Clause` are arbitrary sets, `holds` is an assignment and at the same time a "
    "scenario. The "
    "condition of a clause's activity has a support in a consistent schedule exactly if the assignment satisfies "
    "the clause; "
    "and a consistent schedule exists for each assignment.",
    scope=Scope.GENERAL,
    bound="any formula in conjunctive normal form, with clauses of any size.",
    trusted="Membership in NP: a scenario and a schedule are a certificate. If there is a consistent schedule "
    "there is one whose "
    "times are sums of the plan's bounds (shortest distances), so of polynomial size; checking the bounds and "
    "executing the "
    "events in order takes polynomial time. That the construction takes polynomial time, and that SAT is NP-hard.",
    lemmas=(
        Lemma(
            "reduction",
            "In each consistent schedule, the condition of a clause has a support exactly if the assignment "
            "satisfies it.",
            REDUCTION,
            (
                Variant(
                    "only positive literals have effects.",
                    REDUCTION.with_changed(
                        EFFECTS, forall(BOTH, "(and (= (adds-true v c) (positive c v)) (not (adds-false v c)))")
                    ).with_also(SMALL, ONE),
                ),
                Variant("clause activities may start at any time.", REDUCTION.without(AFTER).with_also(SMALL, ONE)),
            ),
            interesting="(and (positive clause some) (holds some))",
        ),
        Lemma(
            "schedule",
            "Each scenario has a consistent schedule.",
            EXISTS,
            (
                Variant(
                    "assignments and clause activities begin together.",
                    EXISTS.with_changed(
                        DATES,
                        forall(BOTH, "(and (= (end-true v) epsilon) (= (end-false v) epsilon) (= (start c) 0.0))"),
                    ).with_also(SMALL, ONE),
                ),
            ),
        ),
    ),
)
