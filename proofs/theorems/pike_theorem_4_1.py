"""[PIKE] Theorem 4.1: a candidate subplan is inconsistent exactly if it has a temporal conflict."""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.network import FINITE, NETWORK, SHORTEST, TRIANGLE, only
from proofs.theorems._library.terms import Command, Term, conj, const, consts, define, forall, function, sort

# -- soundness: labeled values follow from the plan ------------------------------------------------------------------
HOLD = "both labeled values follow from the plan: where a label holds, the difference of the times is at most the value"
CHAIN = Statement(
    (*consts("Real", "t-i", "t-j", "t-k", "first", "second"), *consts("Bool", "label-1", "label-2")),
    {
        HOLD: "(and (=> label-1 (<= (- t-k t-i) first)) (=> label-2 (<= (- t-j t-k) second)))",
        "both labels hold": "(and label-1 label-2)",
    },
    "(<= (- t-j t-i) (+ first second))",
    {"t(k) − t(i) at most": "first", "t(j) − t(k) at most": "second", "t(i)": "t-i", "t(j)": "t-j", "t(k)": "t-k"},
)
SELF = Statement(
    (*consts("Real", "t", "value"), const("label", "Bool")),
    {
        "the labeled value from an event to itself follows from the plan": "(=> label (<= (- t t) value))",
        "the value is negative": "(< value 0.0)",
    },
    "(not label)",
    {"value": "value", "label holds": "label"},
)

# -- completeness: without a conflict the distances give a schedule --------------------------------------------------
BOUND = "distances are at most the bounds of the plan's constraints that are activated"
SCHEDULE = Statement(
    (
        *NETWORK,
        function("bound", ["Event", "Event"], "Real"),
        function("time", ["Event"], "Real"),
        *consts("Event", "source", "one", "two"),
    ),
    {
        **SHORTEST,
        BOUND: forall({"i": "Event", "j": "Event"}, "(<= (d i j) (bound i j))"),
        "each event is at its distance from one of them": forall({"i": "Event"}, "(= (time i) (d source i))"),
    },
    "(<= (- (time two) (time one)) (bound one two))",
    {"first event at": "(time one)", "second at": "(time two)", "bound": "(bound one two)"},
)

# -- the algorithm reaches shortest distances ------------------------------------------------------------------------
SIZE = 4


def _name(round_: int, i: int, j: int) -> str:
    return f"d{round_}-{i}{j}"


def _run(*, skip: int | None = None) -> tuple[tuple[Command, ...], Term]:
    """All rounds of the triple loop on symbolic bounds; `skip` leaves one intermediate event out."""
    cells = [(i, j) for i in range(SIZE) for j in range(SIZE)]
    commands = [const(f"bound-{i}{j}", "Real") for i, j in cells if i != j]
    commands += [define(_name(0, i, j), {}, "Real", "0.0" if i == j else f"bound-{i}{j}") for i, j in cells]
    steps = []
    for k in range(SIZE):
        for i, j in cells:
            old, detour = _name(k, i, j), f"(+ {_name(k, i, k)} {_name(k, k, j)})"
            commands.append(const(_name(k + 1, i, j), "Real"))
            value = old if k == skip else f"(ite (<= {old} {detour}) {old} {detour})"
            steps.append(f"(= {_name(k + 1, i, j)} {value})")
    return tuple(commands), conj(*steps)


def _loop(*, skip: int | None = None) -> Statement:
    commands, steps = _run(skip=skip)
    nodes = range(SIZE)
    return Statement(
        commands,
        {
            "the triple loop": steps,
            "no event has a negative distance to itself": conj(*(f"(<= 0.0 {_name(SIZE, i, i)})" for i in nodes)),
        },
        conj(
            *(
                f"(<= {_name(SIZE, i, j)} (+ {_name(SIZE, i, k)} {_name(SIZE, k, j)}))"
                for i in nodes
                for j in nodes
                for k in nodes
            ),
            *(f"(<= {_name(SIZE, i, j)} bound-{i}{j})" for i in nodes for j in nodes if i != j),
        ),
        {f"bound from {i} to {j}": f"bound-{i}{j}" for i in nodes for j in nodes if i != j},
    )


LOOP = _loop()

# -- labels: the query of a scenario is that of its conflicts --------------------------------------------------------
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
    {
        DOMINATED: "(and (=> dropped-label kept-label) (< kept dropped))",
        "what is kept": "(=> kept-label (< t kept))",
    },
    "(=> dropped-label (< t dropped))",
    {"kept value": "kept", "dropped value": "dropped", "t": "t"},
)

THEOREM = Theorem(
    name="pike_theorem_4_1",
    title="Inconsistent subplans are those with a temporal conflict",
    source="[PIKE, Theorem 4.1]",
    words="A candidate subplan φ_S is temporally inconsistent if and only if φ_S entails a temporal conflict: an "
    "environment "
    "under which an event has a negative labeled distance to itself.",
    formalisation="In parts: labeled values that the loop combines follow from the plan, so a negative one from an "
    "event to "
    "itself excludes its label; the loop on the bounds that φ_S activates reaches shortest distances; shortest "
    "distances "
    "without negative cycle give a schedule; the query of φ_S is negative exactly if φ_S entails an environment "
    "with a negative "
    "query; dominated pairs may be dropped.",
    scope=Scope.BOUNDED,
    bound=f"the loop for {SIZE} events with any bounds; all other parts general. " + FINITE,
    trusted="For one scenario, labeled sums and minima are sums and minima of the entries whose labels hold in it.",
    lemmas=(
        Lemma(
            "combination",
            "A combination of two labeled values follows from the plan where both labels hold.",
            CHAIN,
            (Variant("only one label holds.", CHAIN.with_changed("both labels hold", "label-1")),),
        ),
        Lemma(
            "negative cycle",
            "A negative labeled value from an event to itself excludes its label.",
            SELF,
            (Variant("the value is not negative.", SELF.without("the value is negative")),),
        ),
        Lemma(
            "loop",
            f"For {SIZE} events and any bounds, the loop ends with shortest distances if there is no negative cycle.",
            LOOP,
            (Variant("one event is never intermediate.", _loop(skip=2)),),
        ),
        Lemma(
            "schedule",
            "Events at their shortest distances from one event meet all bounds.",
            SCHEDULE,
            (
                Variant(
                    "the distances are not shortest.",
                    SCHEDULE.without(TRIANGLE).with_also("three events", only("source", "one", "two")),
                ),
                Variant(
                    "the distances ignore a bound.",
                    SCHEDULE.without(BOUND).with_also("three events", only("source", "one", "two")),
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
    ),
)
