"""The command `robust`: the entry points. Everything else is imported once Ctrl-C is taken care of."""

import atexit
import gc
import os
import signal
import sys
from collections.abc import Sequence


def main() -> None:
    """Run the command of this process and exit."""
    if hasattr(signal, "pthread_sigmask"):
        # For as long as the process lives: neither imports nor the end of the interpreter are to show a traceback.
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
    gc.set_threshold(100_000)  # Hardly anything that is loaded is garbage; looking for it takes 6 % of a check.
    code = 1
    # Taking solvers and formulas apart can take longer than the answer did. First registered is last called.
    atexit.register(lambda: os._exit(code))
    code = run(sys.argv[1:])
    raise SystemExit(code)


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code."""
    from robust.cli.main import run_command

    return run_command(arguments)
