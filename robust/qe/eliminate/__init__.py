"""Quantifier elimination back ends behind one interface; see :mod:`robust.qe.eliminate.interface`."""

from collections.abc import Iterator
from importlib import import_module

from robust.backends import ELIMINATORS
from robust.errors import InputError, SolverError, did_you_mean
from robust.qe.eliminate.interface import Eliminator, Solvers


def create_eliminator(name: str, context: Solvers) -> Eliminator:
    """The back end of that name.

    Raises:
        InputError: if there is no such back end.
        SolverError: if what it needs is not installed.
    """
    if name not in ELIMINATORS:
        raise InputError(f"unknown back end {name!r}{did_you_mean(name, ELIMINATORS)}")
    return _loaded(name)(context, capable)


def capable(capability: str) -> Iterator[str]:
    """The names of the installed back ends that have a capability, such as `alternation`."""
    for name in ELIMINATORS:
        try:
            backend = _loaded(name)
        except SolverError:
            continue
        if getattr(backend, capability):
            yield name


def _loaded(name: str) -> type[Eliminator]:
    module, attribute = ELIMINATORS[name]
    backend: type[Eliminator] = getattr(import_module(module), attribute)
    if not issubclass(backend, Eliminator):
        raise TypeError(f"{attribute} is not an elimination back end")
    return backend
