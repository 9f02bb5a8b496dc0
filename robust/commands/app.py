"""The application: its name, its help, and what every command needs of it."""

from __future__ import annotations

import logging
import sys
from collections.abc import Mapping
from typing import Annotated

import typer

from robust import __version__
from robust.errors import InputError, Location
from robust.report.guard import Guard

CommandLineError: type[Exception] = typer.BadParameter.__mro__[2]
"""What the command line parser raises for wrong usage; `typer` has no public name for it."""

EPILOG = "Exit codes: 0 proved or done, 1 refuted, 2 bad input, 3 unknown, out of time or interrupted, 4 unsupported."

app = typer.Typer(
    name="robust",
    help="Verify temporal plans: are they valid for every schedule, and how far may reality deviate?",
    epilog=EPILOG,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"robust {__version__}")
        raise typer.Exit


@app.callback()
def _top(
    _version: Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", is_eager=True, callback=_show_version)
    ] = False,
) -> None:
    pass


def guard_of(context: typer.Context) -> Guard:
    """The guard of this run; a fresh one, which does nothing, where the application is called by other means."""
    found = context.find_object(Guard)
    return found if isinstance(found, Guard) else Guard()


def refuse(context: typer.Context, names: Mapping[str, str], reason: str) -> None:
    """InputError if one of the options, named by parameter, was typed."""
    for parameter, option in names.items():
        source = context.get_parameter_source(parameter)
        if source is not None and source.name == "COMMANDLINE":
            raise InputError(reason, Location(option))


def configure_logging(verbose: bool) -> None:
    """With `--verbose`, what is done goes to stderr."""
    if verbose:
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(logging.Formatter("%(relativeCreated)7.0f ms  %(name)s: %(message)s"))
        logger = logging.getLogger("robust")
        logger.handlers[:] = [handler]
        logger.setLevel(logging.DEBUG)
