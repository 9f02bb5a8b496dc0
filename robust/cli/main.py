"""From arguments to an exit code, whatever happens on the way.

Exit codes: 0 proved or done, 1 refuted, 2 bad input, or a file or stdout cannot be written, 3 unknown, out of time or
interrupted, 4 unsupported, 141 the reader of stdout has left. Answers go to stdout, everything else to stderr.
"""

import errno
import os
import sys
from collections.abc import Sequence
from functools import partial

from robust import __version__
from robust.cli.build import Command, Group, application, read
from robust.cli.guard import GivenUpError, Guard, carry_out
from robust.cli.output import READER_LEFT, complain, drop_output, output_failure, print_json
from robust.errors import UNDECIDED, RobustError, from_extra, refused

HELP = "Verify temporal plans: are they valid for every schedule, and how far may reality deviate?"

COMMANDS: dict[str, Command | Group] = {
    "check": Command("Is a plan valid for every schedule it allows?", "robust.cli.plans:check"),
    "envelope": Command("How far may parameters deviate?", "robust.cli.plans:envelope"),
    "region": Command("All parameter values for which a plan is valid.", "robust.cli.plans:region"),
    "compare": Command("Compare boxes of IRR, CCMMZ and exact methods with the region.", "robust.cli.plans:compare"),
    "risk": Command("How likely does a plan succeed?", "robust.cli.plans:risk"),
    "rank": Command("Which of several plans of one problem bears most?", "robust.cli.plans:rank"),
    "learn": Command("How long do actions take, by logs of their runs?", "robust.cli.plans:learn"),
    "repair": Command("The least change after which a plan is valid, or robust enough.", "robust.cli.plans:repair"),
    "validate": Command("Is a plan valid as it stands, at the times that it says?", "robust.cli.execution:validate"),
    "convert": Command("Make a flexible plan of a planner's output.", "robust.cli.execution:convert"),
    "execute": Command("Execute in simulated worlds, and plan anew when needed.", "robust.cli.execution:execute"),
    "watch": Command("Follow a plan while it runs: what may start, and is there time left?", "robust.cli.watch:watch"),
    "certify": Command("Write down why a plan is valid, for a checker without solver.", "robust.cli.certify:certify"),
    "verify": Command("Check a certificate, in a process of its own.", "robust.cli.certify:verify"),
    "demo": Command("Take a tour on shipped examples.", "robust.cli.execution:demo"),
    "pike": Group(
        "Plans with choices: which still lead to a correct execution?",
        {
            "check": Command("Does a correct execution exist, and in which scenarios?", "robust.cli.pike:check"),
            "chance": Command("How likely do people's choices leave a correct execution?", "robust.cli.pike:chance"),
            "compile": Command("Compile the knowledge base of all correct executions.", "robust.cli.pike:compile_"),
            "run": Command("Execute a plan with choices with a simulated team.", "robust.cli.pike:run"),
            "plot": Command("Draw a plan with choices.", "robust.cli.pike:plot"),
            "new": Command("Write a plan with choices to begin with.", "robust.cli.pike:new"),
            "region": Command("Which choices are possible for which durations and limits?", "robust.cli.pike:region"),
            "envelope": Command(
                "How far may durations and limits deviate, whatever is chosen?", "robust.cli.pike:envelope"
            ),
        },
    ),
    "stnu": Group(
        "Networks with uncertainty of other tools: controllable, likely, dispatched, repaired.",
        {
            "check": Command("Are networks dynamically controllable, and if not, why?", "robust.cli.stnu:check"),
            "risk": Command("How likely can a network with random lengths be executed?", "robust.cli.stnu:risk"),
            "dispatch": Command("The minimal dispatchable network, and executions.", "robust.cli.stnu:dispatch"),
            "repair": Command("The least change that makes a network controllable.", "robust.cli.stnu:repair"),
        },
    ),
    "batch": Group(
        "One question about many plans of your own: a folder, or a list.",
        {
            "check": Command("Is each plan valid for every schedule it allows?", "robust.cli.batch:check"),
            "envelope": Command("How far may the parameters of each deviate?", "robust.cli.batch:envelope"),
            "region": Command("All parameter values for which each is valid.", "robust.cli.batch:region"),
            "compare": Command("CCMMZ against IRR: who answers, how fast, which box.", "robust.cli.batch:compare"),
        },
    ),
    "bench": Group(
        "Measure: recorded data sets, the figures of the paper, scaling studies.", "robust.cli.batch:EXPERIMENTS"
    ),
}
"""A new command is a line here, and an action where it says."""

_BAD_USE = 2
_INTERRUPTED = 130
"""What typer makes of a `KeyboardInterrupt`."""


def run_command(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; never raises."""
    if not _prepare_streams():
        complain("error: found standard output closed, expected somewhere to write the answer to, such as /dev/null")
        return _BAD_USE
    with Guard() as guard:
        code = _guarded(arguments, guard)
        failure = output_failure()
        if failure is None:
            return code
        if isinstance(failure, BrokenPipeError):
            return READER_LEFT
        if failure.errno == errno.EIO and guard.cause is not None:
            return UNDECIDED  # the terminal is gone, which has sent SIGHUP
        complain(f"error: cannot write to standard output: {(failure.strerror or str(failure)).lower()}")
        return _BAD_USE


def _guarded(arguments: Sequence[str], guard: Guard) -> int:
    try:
        return _run(list(arguments), guard)
    except (KeyboardInterrupt, GivenUpError) as error:
        cause = guard.why(error)
        return _report(arguments, guard, RobustError(cause.message), cause.value, code=UNDECIDED, message=cause.message)
    except BrokenPipeError as error:
        drop_output(error)
        return UNDECIDED
    except RobustError as error:
        return _report(arguments, guard, error, type(error).__name__.removesuffix("Error").lower())
    except OSError as error:
        return _report_failure(arguments, guard, error)
    except Exception as error:  # the last resort: a user never sees a traceback unasked
        return _report_internal(arguments, guard, error)


def _run(arguments: list[str], guard: Guard) -> int:
    with guard.working():
        completing = "_ROBUST_COMPLETE" in os.environ
        command = None if completing else read(COMMANDS, arguments)
    if command is not None:
        return carry_out(guard, *command)
    with guard.working():
        import typer

        words = _typed_so_far() if completing else arguments
        app = application(COMMANDS, words, HELP, f"robust {__version__}", partial(carry_out, guard))
        wrong_usage: type[Exception] = typer.BadParameter.__mro__[2]  # there is no public name for it
    try:
        code = app(args=arguments, prog_name="robust", standalone_mode=False)
    except wrong_usage as error:
        return _report_misuse(arguments, guard, error)
    except SystemExit as end:  # how completion answers fish whether there is anything to complete
        code = end.code
        if isinstance(end.__context__, BrokenPipeError):  # nobody reads the help text
            drop_output(end.__context__)
    if code == _INTERRUPTED:
        raise KeyboardInterrupt
    return code if isinstance(code, int) else 0


def _typed_so_far() -> list[str]:
    """The words after `robust` on the line that is to be completed; bash says them unlike other shells."""
    return (os.environ.get("COMP_WORDS") or os.environ.get("_TYPER_COMPLETE_ARGS", "")).split()[1:]


# -- what goes wrong -------------------------------------------------------------------------------------------------


def _report(
    arguments: Sequence[str],
    guard: Guard,
    error: RobustError,
    kind: str,
    *,
    code: int | None = None,
    message: str | None = None,
) -> int:
    """One line on stderr and, for programs that have no answer yet, one object on stdout."""
    code = error.exit_code if code is None else code
    if "--json" in arguments and not guard.answered:
        from robust.show.documents import error as document

        print_json(document(error, kind, code))
    complain(message or f"error: {error}")
    return code


def _report_failure(arguments: Sequence[str], guard: Guard, error: OSError) -> int:
    """Report an operation that the system refused."""
    if guard.cause is not None and error.errno == errno.EIO and not error.filename:
        drop_output(error)  # the terminal is gone, which has sent SIGHUP
        return UNDECIDED
    return _report(arguments, guard, refused(error), "input")


def _report_misuse(arguments: Sequence[str], guard: Guard, error: Exception) -> int:
    message = getattr(error, "format_message", error.__str__)().strip().replace("Value error, ", "")
    if not arguments or message.startswith("Usage:"):
        print(message, file=sys.stderr)
        return _BAD_USE
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "robust"
    message = message if message.endswith((".", "?", "!")) else f"{message}."
    return _report(arguments, guard, RobustError(f"{message} Try '{command} --help'."), "usage", code=_BAD_USE)


def _report_internal(arguments: Sequence[str], guard: Guard, error: Exception) -> int:
    if isinstance(error, ModuleNotFoundError) and (known := from_extra(error)) is not None:
        return _report(arguments, guard, known, "unsupported")
    if "--verbose" in arguments:
        import logging

        logging.getLogger(__name__).exception("internal error")
    text = " ".join(f"{type(error).__name__}: {error}".split())
    if len(text) > 300:
        text = f"{text[:300]}..."
    remedy = "" if "--verbose" in arguments else ", with the output of --verbose"
    message = f"internal error: {text}; please report this{remedy}"
    return _report(arguments, guard, RobustError(message), "internal", code=UNDECIDED, message=message)


def _prepare_streams() -> bool:
    """Make streams that any text can be written to; whether there is somebody to answer to."""
    closed = sys.stdout is None
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the caller, as in `robust ... >&-`
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - as long as the process
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal without γ shows `?` instead of a traceback
    return not closed
