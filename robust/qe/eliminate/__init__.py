"""Quantifier elimination back ends behind one interface; see :mod:`robust.qe.eliminate.interface`."""

from __future__ import annotations

from importlib import import_module

from robust.backends import ELIMINATORS
from robust.errors import InputError, did_you_mean
from robust.qe.eliminate.interface import Eliminator, Solvers


def create_eliminator(name: str, context: Solvers) -> Eliminator:
    """The back end of that name.

    Raises:
        InputError: if there is no such back end.
        SolverError: if what it needs is not installed.
    """
    if name not in ELIMINATORS:
        raise InputError(f"unknown back end {name!r}{did_you_mean(name, ELIMINATORS)}")
    module, attribute = ELIMINATORS[name]
    made = getattr(import_module(module), attribute)(context)
    if not isinstance(made, Eliminator):
        raise TypeError(f"{attribute} is not an elimination back end")
    return made
