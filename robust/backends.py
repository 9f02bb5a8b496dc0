"""Solvers, encodings and back ends by name: names only, so that `--help` imports none of them.

Whoever adds one writes it here; the registries beside the interfaces import what is chosen.
"""

SOLVERS = ("z3", "cvc5")

ENCODINGS = ("relational", "positions")
"""How a plan becomes formulas, see :func:`robust.encode.create_encoding`."""

CONVERSIONS = ("room", "causal", "esterel")
"""Ways in which steps of a planner become a network."""

ELIMINATORS = {
    "project": ("robust.qe.eliminate.enumerate", "Project"),
    "z3": ("robust.qe.eliminate.z3_tactics", "Z3Tactic"),
    "cvc5": ("robust.qe.eliminate.cvc5_native", "Cvc5Disjuncts"),
    "fourier-motzkin": ("robust.qe.eliminate.enumerate", "FourierMotzkin"),
    "loos-weispfenning": ("robust.qe.eliminate.loos_weispfenning", "LoosWeispfenning"),
}
"""Back ends of quantifier elimination, and where each lives."""

OFFERED = tuple(ELIMINATORS)
"""Their names, as users choose them."""

SPLITTINGS = ("monolithic", "partial", "full")
"""How elimination problems are grouped, see :mod:`robust.qe.compute`."""

KNOWLEDGE_BASES = ("pitms", "pitms-labels", "atms", "sat", "bdd")
"""Who reasons about choices, see :mod:`robust.pike_bridge.knowledge`."""

SMT, WINDOWS, DRAKE, KIRK = REASONERS = ("smt", "windows", "drake", "kirk")
"""Who decides for an executive, see :mod:`robust.pike_bridge.online.reasoners`, and of Kirk
:mod:`robust.pike_bridge.online.kirk`."""


def deciding(reasoner: str | None, backend: str | None) -> str:
    """The name of what decides: that of a knowledge base, or `smt`; of either what is given says which."""
    return backend or (SMT if reasoner in {None, SMT, KIRK} else KNOWLEDGE_BASES[0])
