"""Writing answers to stdout, whose reader may leave at any time, as in `robust ... | head`."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any


@contextmanager
def answering() -> Iterator[None]:
    """Output that nobody reads any more is dropped; the exit code still says what the answer was."""
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        drop_output()


def drop_output() -> None:
    """Send what is still written to stdout nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def print_json(answer: Mapping[str, Any]) -> None:
    """Print one object, as an answer."""
    with answering():
        print(json.dumps(answer, indent=2))
