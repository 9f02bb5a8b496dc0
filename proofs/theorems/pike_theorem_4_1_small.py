"""[PIKE] Theorem 4.1, bounded: the loop for four events, all of its rounds written out.

A second formalisation of what `pike_theorem_4_1` proves in general: rounds are given, and no induction is needed.
"""

from proofs.theorems._library.model import Lemma, Scope, Statement, Theorem, Variant
from proofs.theorems._library.terms import Command, Term, conj, const, define

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

THEOREM = Theorem(
    name="pike_theorem_4_1_small",
    title="Inconsistent subplans are those with a temporal conflict: four events",
    source="[PIKE, Theorem 4.1]",
    words="For one scenario, the loop on the bounds between four events ends with distances that no detour shortens, "
    "unless some event has a negative distance to itself.",
    formalisation="Each distance after each round is a constant, the bounds are arbitrary. A second look at what is "
    "proved in general above.",
    scope=Scope.BOUNDED,
    bound=f"the loop for {SIZE} events with any bounds, none of them strict.",
    lemmas=(
        Lemma(
            "loop",
            f"For {SIZE} events and any bounds, the loop ends with shortest distances if there is no negative cycle.",
            LOOP,
            (Variant("one event is never intermediate.", _loop(skip=2)),),
        ),
    ),
)
