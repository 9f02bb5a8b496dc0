"""The executive of plans with choices: recognise intent and adapt to it while the plan is carried out [PIKE §3]."""

from __future__ import annotations

from robust.backends import SMT
from robust.pike_bridge.knowledge import knowledge_bases


def reasoner_names() -> tuple[str, ...]:
    """What :func:`robust.pike_bridge.online.reasoners.make_reasoner` knows: `smt`, and what windows ask."""
    return (SMT, *knowledge_bases())
