"""The parametrized planning problem and plan: data model, readers, writers and parametrization.

The names below are loaded on first use, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robust.plan.load import assemble, load_plan
    from robust.plan.model import Parameter, ParametrizedPlan
    from robust.plan.parameters import ParameterSpec, parse_spec, parse_specs, read_parameter_file
    from robust.plan.stn import STNPlan, parse_stn, read_stn, write_stn
    from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan, read_timed_plan, write_timed_plan

_HOME = {
    "load": ("assemble", "load_plan"),
    "model": ("Parameter", "ParametrizedPlan"),
    "parameters": ("ParameterSpec", "parse_spec", "parse_specs", "read_parameter_file"),
    "stn": ("STNPlan", "parse_stn", "read_stn", "write_stn"),
    "timed": ("TimedPlan", "TimedStep", "parse_timed_plan", "read_timed_plan", "write_timed_plan"),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "Parameter",
    "ParameterSpec",
    "ParametrizedPlan",
    "STNPlan",
    "TimedPlan",
    "TimedStep",
    "assemble",
    "load_plan",
    "parse_spec",
    "parse_specs",
    "parse_stn",
    "parse_timed_plan",
    "read_parameter_file",
    "read_stn",
    "read_timed_plan",
    "write_stn",
    "write_timed_plan",
]


def __getattr__(name: str) -> object:
    if name not in _MODULE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULE[name]}"), name)
