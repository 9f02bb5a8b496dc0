"""Knowledge bases over finite-domain variables, behind one interface."""

from robust.pike_bridge.knowledge.registry import (
    Registration,
    create_knowledge_base,
    knowledge_bases,
    reasons_about_time,
    register_knowledge_base,
)

__all__ = [
    "Registration",
    "create_knowledge_base",
    "knowledge_bases",
    "reasons_about_time",
    "register_knowledge_base",
]
