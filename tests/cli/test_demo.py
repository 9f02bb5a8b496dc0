"""`robust demo`: runs, is quick, and shows commands that can be typed as they are."""

import re
import shlex
import time
from pathlib import Path

from tests.cli.running import command


def test_tour():
    before = Path.cwd()
    started = time.process_time()
    ended = command("demo")
    assert time.process_time() - started < 3
    assert (ended.code, ended.err) == (0, "")
    assert Path.cwd() == before
    verdicts = [line.split(":")[0] for line in ended.out.splitlines() if re.match(r"(proved|refuted|complete)", line)]
    assert verdicts == ["proved", "refuted", "complete", "complete"]
    assert "✗ violated" in ended.out
    assert ended.out.splitlines()[-6] == "Where to go next"


def test_commands_work_as_shown(monkeypatch):
    """What the tour says is what the commands print, up to times and the number of checks, which solvers decide."""
    lines = command("demo").out.splitlines()
    shown = [shlex.split(line.removeprefix("$ ")) for line in lines if line.startswith("$ ")]
    assert [words[0] for words in shown] == ["cd", "robust", "robust", "robust", "cd", "robust"]
    tour = {_untimed(line) for line in lines}
    for program, *arguments in shown:
        if program == "cd":
            monkeypatch.chdir(arguments[0])
        else:
            printed = command(*arguments).out.splitlines()
            assert [line for line in printed if _untimed(line) not in tour] == []


def _untimed(line: str) -> str:
    return re.sub(r"\d+ checks", "CHECKS", re.sub(r"\d+\.\d+ s", "TIME", line))
