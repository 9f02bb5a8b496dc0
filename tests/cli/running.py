"""Running the command line: in this process, or as a process of its own."""

import json
import logging
import os
import signal
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile

import jsonschema

from robust.cli import run
from tests.schemas import schema

REPOSITORY = Path(__file__).parents[2]
EXAMPLES = REPOSITORY / "robust" / "examples"
NAVIGATION = EXAMPLES / "two_sample_navigation"
LOAD = max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
"""How many processes share a processor now: everything takes that much longer."""
COMMAND = (sys.executable, "-m", "robust")


@dataclass(frozen=True)
class Ended:
    """What a command line came to."""

    code: int
    out: str
    err: str
    seconds: float = 0.0
    """For a process that was sent a signal: from then to its end."""


def answer_of(ended, name=None):
    """The JSON object that was printed, which is valid by its schema."""
    answer = json.loads(ended.out)
    assert name in (None, answer["schema"])
    jsonschema.validate(answer, schema(answer["schema"]), cls=jsonschema.Draft202012Validator)
    return answer


def assert_one_line(ended, code=2, says=""):
    """A message of one line, and nothing else."""
    assert (ended.code, ended.out) == (code, ""), ended
    assert ended.err.startswith("robust: error: ")
    assert (ended.err.count("\n"), ended.err[-1:]) == (1, "\n")
    assert says in ended.err


def example(plan="plan.stn", directory=NAVIGATION):
    return [str(directory / "domain.pddl"), str(directory / "problem.pddl"), str(directory / plan)]


def command(*arguments):
    """In this process; what only a process shows (signals, streams, imports) is tested with :func:`process`."""
    logger, streams = logging.getLogger("robust"), {"mode": "w+", "encoding": "utf-8", "newline": ""}
    with TemporaryFile(**streams) as out, TemporaryFile(**streams) as err:
        try:
            with redirect_stdout(out), redirect_stderr(err):
                code = run([str(argument) for argument in arguments])
        finally:
            logger.handlers.clear()
            logger.setLevel(logging.NOTSET)
        for stream in (out, err):
            stream.seek(0)
        return Ended(code, out.read(), err.read())


def environment(**more):
    return {**os.environ, "PYTHONPATH": str(REPOSITORY), "COLUMNS": "80", **more}


def ran(*words, **options):
    """Any program, in a process."""
    settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": environment(), "timeout": 60, **options}
    done = subprocess.run([str(word) for word in words], check=False, text=True, **settings)
    return Ended(done.returncode, done.stdout, done.stderr)


def process(*arguments, **options):
    """A process of its own."""
    return ran(*COMMAND, *arguments, **options)


def started(*arguments, **options):
    """A process of its own that goes on."""
    words = [*COMMAND, *(str(argument) for argument in arguments)]
    settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options}
    return subprocess.Popen(words, **{"env": environment(), **settings})


def stopped(*arguments, after, number=signal.SIGINT):
    """A process that gets a signal after some seconds, or when it has logged (`--verbose`) a text."""
    with started(*arguments) as running:
        if isinstance(after, str):
            while after not in (line := running.stderr.readline()):
                assert line, f"ended before it logged {after!r}"
        else:
            time.sleep(after)
        sent = time.perf_counter()
        running.send_signal(number)
        out, err = running.communicate(timeout=30)
        return Ended(running.returncode, out, err, time.perf_counter() - sent)
