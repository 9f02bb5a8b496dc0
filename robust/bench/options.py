"""Checks of options that the drivers share, made before anything runs for hours."""

from __future__ import annotations

import math
import os
from importlib import import_module
from pathlib import Path
from types import ModuleType

from robust.errors import InputError

PLOT_SUFFIXES = (".svg", ".png", ".pdf")


def check_limit(limit: float | None) -> None:
    """InputError unless the limit is None or a positive number of seconds."""
    if limit is not None and not (math.isfinite(limit) and limit > 0):
        raise InputError(f"the limit is {limit}; expected a positive number of seconds")


def plotting(plot: Path | None, module: str = "robust.bench.plots") -> ModuleType | None:
    """The module that draws if a plot is wanted; it imports matplotlib, which is slow.

    Raises:
        InputError: if the plot cannot be written, or its suffix names no format.
    """
    if plot is None:
        return None
    if plot.suffix.lower() not in PLOT_SUFFIXES:
        raise InputError(f"the plot is {str(plot)!r}; expected a name that ends in {', '.join(PLOT_SUFFIXES)}")
    directory = plot.parent
    if not directory.is_dir():
        raise InputError(f"the plot is {str(plot)!r}, but there is no directory {str(directory)!r}; create it first")
    if not os.access(plot if plot.exists() else directory, os.W_OK) or plot.is_dir():
        raise InputError(f"the plot is {str(plot)!r}, which cannot be written; choose another place")
    return import_module(module)
