"""The commands of `robust`: options to calls, results to text or JSON. What they compute is elsewhere.

A new command is a module here that registers itself on the application, and a name in the list below.
"""

from __future__ import annotations

from importlib import import_module

from robust.commands.app import CommandLineError, app

__all__ = ["CommandLineError", "app"]

for _name in (
    "check",
    "envelope",
    "region",
    "compare",
    "convert",
    "execute",
    "certify",
    "pike",
    "demo",
    "bench",
    "bench_intents",
):  # the order of the help text
    import_module(f"{__name__}.{_name}")
