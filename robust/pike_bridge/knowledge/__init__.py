"""Knowledge bases over finite-domain variables by name, behind one interface; each is imported when it is created."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.model import Tpnu
from robust.pike_bridge.theory import KnowledgeBase, KnowledgeStatistics, Theory
from robust.smt.limits import NEVER, Deadline


@dataclass(frozen=True, slots=True)
class Registration:
    """Where a knowledge base is, and what it can be given beyond a theory, a deadline and statistics."""

    module: str
    name: str
    takes: frozenset[str] = frozenset()
    """Of `network`, `solver` and `shortcut`; what takes a network reasons about time itself."""
    knows_implicants: bool = False
    """Whether it counts and lists all prime implicants: `HasImplicants`."""
    labels: bool = False
    """Whether it labels the nodes of formulas."""


_HERE = "robust.pike_bridge.knowledge"
_LABELING = frozenset({"solver", "shortcut"})
_REGISTRY = {
    "pitms": Registration(f"{_HERE}.tms", "PiTms", _LABELING, knows_implicants=True, labels=True),
    "pitms-labels": Registration(
        f"{_HERE}.propagation", "PropagatedLabels", _LABELING, knows_implicants=True, labels=True
    ),
    "atms": Registration(f"{_HERE}.tms", "Atms", _LABELING, labels=True),
    "bdd": Registration(f"{_HERE}.bdd", "BddKnowledgeBase", knows_implicants=True),
    "sat": Registration(f"{_HERE}.sat", "SatKnowledgeBase", frozenset({"network", "solver"})),
}


def knowledge_bases() -> Mapping[str, Registration]:
    """The knowledge bases that there are.

    Returns:
        By name, what each is made from, and what it can do.
    """
    return dict(_REGISTRY)


def reasons_about_time(name: str) -> bool:
    """Whether the knowledge base of that name takes a network instead of temporal conflicts.

    Raises:
        InputError: if there is no such knowledge base.
    """
    return "network" in _registration(name).takes


def create_knowledge_base(
    name: str,
    theory: Theory,
    *,
    network: Tpnu | None = None,
    solver: str = "z3",
    shortcut: bool = True,
    deadline: Deadline = NEVER,
    statistics: KnowledgeStatistics | None = None,
) -> KnowledgeBase:
    """Compile a theory into the knowledge base of that name.

    Args:
        network: for those that reason about time; its guarded temporal constraints become part of the theory.
        solver: `z3` or `cvc5`, for those that ask one.
        shortcut: whether a solver is asked first whether there is any model, for those that compile labels.
        deadline: for compiling.
        statistics: counters to add to; readable even if compiling ends early.

    Raises:
        InputError: if there is no such knowledge base, if it takes no network but got one, or if the theory is wrong.
        SolverError: if the solver is unknown or not installed.
        OutOfTimeError: if the deadline passes.
    """
    registration = _registration(name)
    if network is not None and not reasons_about_time(name):
        able = ", ".join(filter(reasons_about_time, _REGISTRY))
        expected = f"expected the temporal conflicts in the theory, or one of {able}"
        raise InputError(f"knowledge base {name!r} takes no network; {expected}")
    options: Mapping[str, Any] = {"network": network, "solver": solver, "shortcut": shortcut}
    taken = {option: options[option] for option in registration.takes}
    create: Callable[..., KnowledgeBase] = getattr(import_module(registration.module), registration.name)
    return create(theory, deadline=deadline, statistics=statistics, **taken)


def _registration(name: str) -> Registration:
    if name not in _REGISTRY:
        raise InputError(f"unknown knowledge base {name!r}{did_you_mean(name, _REGISTRY)}")
    return _REGISTRY[name]
