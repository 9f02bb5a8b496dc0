"""`robust demo`."""

from __future__ import annotations

import typer

from robust.commands.app import app, guard_of


@app.command(short_help="Take a tour on shipped examples.")
def demo(context: typer.Context) -> int:
    """Take a tour: check and envelope on examples that come with the program."""
    with guard_of(context).working():
        from robust.report.demo import run_demo  # noqa: PLC0415 - heavy

    return run_demo(guard_of(context))
