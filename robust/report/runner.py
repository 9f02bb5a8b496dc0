"""From arguments to an exit code, whatever happens on the way.

Exit codes: 0 proved or done, 1 refuted, 2 bad input, 3 unknown, out of time or interrupted, 4 unsupported. Answers go
to stdout, everything else to stderr. The commands themselves are in :mod:`robust.commands`.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

from robust.errors import InputError, RobustError
from robust.report.guard import UNDECIDED, Cause, GivenUpError, Guard
from robust.report.output import drop_output, print_json

log = logging.getLogger(__name__)

Load = Callable[[], tuple[Callable[..., Any], type[Exception]]]

_BAD_USE = 2
_INTERRUPTED = 130
"""What typer makes of a `KeyboardInterrupt`."""


def run_command(arguments: Sequence[str], load: Load) -> int:
    """Run one command line and return its exit code; never raises.

    `load` imports the application, and what it raises for wrong usage: while that is going on, Ctrl-C is heeded.
    """
    _prepare_streams()
    with Guard() as guard:
        try:
            return _run(arguments, guard, load)
        except (KeyboardInterrupt, GivenUpError):
            return _report_stop(arguments, guard.cause or Cause.INTERRUPTED)
        except BrokenPipeError:
            drop_output()
            return UNDECIDED
        except RobustError as error:
            return _report(arguments, error, _kind(error))
        except OSError as error:
            place = f"{error.filename}: " if error.filename else ""
            return _report(arguments, InputError(f"{place}{error.strerror or error}"), "input")
        except Exception as error:  # the last resort: a user never sees a traceback unasked
            return _report_internal(arguments, error)


def _run(arguments: Sequence[str], guard: Guard, load: Load) -> int:
    with guard.working():
        app, wrong_usage = load()

    try:
        code = app(args=list(arguments), prog_name="robust", standalone_mode=False, obj=guard)
    except wrong_usage as error:
        return _report_misuse(arguments, error)
    if code == _INTERRUPTED:
        raise KeyboardInterrupt
    return code if isinstance(code, int) else 0


# -- what goes wrong -------------------------------------------------------------------------------------------------


def _report(
    arguments: Sequence[str], error: RobustError, kind: str, code: int | None = None, message: str | None = None
) -> int:
    """One line on stderr and, for programs, one object on stdout."""
    code = error.exit_code if code is None else code
    try:
        if "--json" in arguments:
            from robust.report.answers import error_answer  # noqa: PLC0415 - only where needed

            print_json(error_answer(error, kind, code))
        _complain(message or f"error: {error}")
    except OSError:
        drop_output()  # there is no way left to say anything
    return code


def _report_misuse(arguments: Sequence[str], error: Exception) -> int:
    message = getattr(error, "format_message", error.__str__)().strip().replace("Value error, ", "")
    if not arguments or message.startswith("Usage:"):
        print(message, file=sys.stderr)  # noqa: T201 - a command group without a command: its help
        return _BAD_USE
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "robust"
    message = message if message.endswith((".", "?", "!")) else f"{message}."
    return _report(arguments, RobustError(f"{message} Try '{command} --help'."), "usage", _BAD_USE)


def _report_stop(arguments: Sequence[str], cause: Cause) -> int:
    """Stopped before there was anything to show."""
    return _report(arguments, RobustError(cause.message), cause.value, UNDECIDED, cause.message)


def _report_internal(arguments: Sequence[str], error: Exception) -> int:
    if "--verbose" in arguments:
        log.exception("internal error")
    text = " ".join(f"{type(error).__name__}: {error}".split())
    if len(text) > 300:
        text = f"{text[:300]}..."
    remedy = "" if "--verbose" in arguments else ", with the output of --verbose"
    message = f"internal error: {text}; please report this{remedy}"
    return _report(arguments, RobustError(message), "internal", UNDECIDED, message)


def _kind(error: RobustError) -> str:
    return type(error).__name__.removesuffix("Error").lower()


def _complain(message: str) -> None:
    """One line on stderr, whatever file names and input texts contain."""
    line = "".join(char if char.isprintable() else " " for char in message)
    print(f"robust: {line}", file=sys.stderr)  # noqa: T201 - where messages go


def _prepare_streams() -> None:
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the caller, as in `robust ... >&-`
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - as long as the process
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal without γ shows `?` instead of a traceback


def flush() -> None:
    """Write what is still in memory."""
    try:
        sys.stdout.flush()
    except OSError:
        drop_output()
