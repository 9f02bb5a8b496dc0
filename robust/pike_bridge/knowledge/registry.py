"""Knowledge bases by name; each is imported when it is first created."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from robust.errors import InputError, did_you_mean
from robust.pike_bridge.knowledge.interface import KnowledgeBase, KnowledgeStatistics
from robust.pike_bridge.model import Tpnu
from robust.pike_bridge.theory import Theory
from robust.smt.limits import Deadline


@dataclass(frozen=True, slots=True)
class Registration:
    """Where a knowledge base is, and what it can be given beyond a theory and a deadline."""

    module: str
    attribute: str
    summary: str
    takes_network: bool = False
    """Whether it reasons about time itself, so that temporal conflicts need not be known."""
    takes_solver: bool = False
    takes_shortcut: bool = False
    knows_implicants: bool = False
    """Whether it counts and lists all prime implicants: `HasImplicants`."""


_HOME = "robust.pike_bridge.knowledge"
_REGISTRY: dict[str, Registration] = {
    "pitms": Registration(
        f"{_HOME}.tms",
        "PiTms",
        "labels of prime implicants",
        takes_solver=True,
        takes_shortcut=True,
        knows_implicants=True,
    ),
    "atms": Registration(f"{_HOME}.tms", "Atms", "minimal labels", takes_solver=True, takes_shortcut=True),
    "bdd": Registration(f"{_HOME}.bdd", "BddKnowledgeBase", "a binary decision diagram", knows_implicants=True),
    "sat": Registration(
        f"{_HOME}.sat",
        "SatKnowledgeBase",
        "an incremental solver, nothing compiled",
        takes_network=True,
        takes_solver=True,
    ),
}


def knowledge_bases() -> Mapping[str, Registration]:
    """What is registered, by name."""
    return dict(_REGISTRY)


def register_knowledge_base(name: str, registration: Registration) -> None:
    """Make another knowledge base known; its class takes a theory, `deadline`, `statistics`, and what is registered.

    Raises:
        InputError: if the name is taken.
    """
    if name in _REGISTRY:
        raise InputError(f"knowledge base {name!r} is registered already; expected another name")
    _REGISTRY[name] = registration


def reasons_about_time(name: str) -> bool:
    """Whether the knowledge base of that name takes a network instead of temporal conflicts.

    Raises:
        InputError: if there is no such knowledge base.
    """
    return _registration(name).takes_network


def create_knowledge_base(
    name: str,
    theory: Theory,
    *,
    network: Tpnu | None = None,
    solver: str = "z3",
    shortcut: bool = True,
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
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
    options: dict[str, Any] = {}
    if network is not None:
        if not registration.takes_network:
            able = [each for each, entry in _REGISTRY.items() if entry.takes_network]
            raise InputError(
                f"knowledge base {name!r} takes no network; expected the temporal conflicts in the theory, or one of "
                f"{', '.join(able)}"
            )
        options["network"] = network
    if registration.takes_solver:
        options["solver"] = solver
    if registration.takes_shortcut:
        options["shortcut"] = shortcut
    factory = getattr(import_module(registration.module), registration.attribute)
    created: KnowledgeBase = factory(theory, deadline=deadline, statistics=statistics, **options)
    return created


def _registration(name: str) -> Registration:
    if name not in _REGISTRY:
        raise InputError(f"unknown knowledge base {name!r}{did_you_mean(name, _REGISTRY)}")
    return _REGISTRY[name]
