"""All theorems: one per module of `proofs/theorems/` whose name does not begin with an underscore."""

from __future__ import annotations

import importlib
from pathlib import Path

from proofs.theorems._library.model import Theorem

FOLDER = Path(__file__).resolve().parents[1]


def names() -> list[str]:
    """The modules in the order of the alphabet."""
    return sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))


def load(name: str) -> Theorem:
    """The theorem of one module.

    Raises:
        ValueError: if the module has no theorem of its own name.
    """
    theorem = getattr(importlib.import_module(f"proofs.theorems.{name}"), "THEOREM", None)
    if not isinstance(theorem, Theorem) or theorem.name != name:
        raise ValueError(f"proofs/theorems/{name}.py has no THEOREM with name {name!r}; add one")
    return theorem


def load_all() -> list[Theorem]:
    return [load(name) for name in names()]
