"""Where answers are printed: colours where they are wanted, tables that keep every word; and completion."""

import re
import shlex
import shutil
from collections import Counter
from io import StringIO

import hypothesis
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.show.console import console
from robust.show.tables import show_table, table
from tests.cli.running import command, environment, example, ran

WAITING = example("plan-flexible-wait.stn")


@given(st.lists(st.tuples(*[st.text("abc (,)", max_size=20)] * 4), min_size=1, max_size=5), st.integers(40, 120))
@hypothesis.example([("a" * 8, "", "a" * 6, " " + "a" * 9)], 40)
def test_tables_keep_every_word(rows, width):
    printed = StringIO()
    show_table(console(printed, width=width), table(("first", "second", "third", "fourth"), rows, right=("second",)))
    seen = Counter(re.sub("─+", " ", printed.getvalue()).split())
    joined = Counter({word.rstrip(","): count for word, count in seen.items()})  # what joins the lines of a cell sticks
    assert not Counter(" ".join(cell for row in rows for cell in row).split()) - seen - joined
    assert all(len(line) <= width or " " not in line.strip() for line in printed.getvalue().splitlines())


@pytest.mark.parametrize(
    ("option", "variables", "colored"),
    [
        ((), {}, False),
        (("--color", "auto"), {}, False),
        (("--color", "always"), {}, True),
        (("--color=always",), {"NO_COLOR": "1"}, True),
        (("--color", "never"), {"FORCE_COLOR": "1"}, False),
        ((), {"FORCE_COLOR": "1"}, True),
        ((), {"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
    ],
    ids=str,
)
def test_colors_are_where_they_are_wanted(option, variables, colored, monkeypatch):
    for name in ("NO_COLOR", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {"TERM": "xterm", **variables}.items():
        monkeypatch.setenv(name, value)
    ended = command("check", *WAITING, *option, "--quiet")
    assert (ended.code, "\x1b[1;31m" in ended.out) == (1, colored)
    assert "\x1b" not in command("check", *WAITING, *option, "--json").out


LINES = {
    "robust envel": "envelope",
    "robust pike comp": "compile",
    "robust envelope --meth": "--method",
    "robust envelope --method wid": "widen",
}
SHELLS = {
    "bash": ("bash", "-c", '. "$0"; COMP_WORDS=($1); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); '
             '_robust_completion robust; echo "${COMPREPLY[@]}"'),
    "fish": ("fish", "-c", 'source $argv[1]; complete -C $argv[2]'),
}  # fmt: skip
"""How a shell completes a line by a script."""


@pytest.fixture(scope="module")
def home(tmp_path_factory, warm):
    """A home directory, with the command `robust` in it."""
    program = tmp_path_factory.mktemp("home") / "robust"
    program.write_text(f'#!/bin/sh\nexec {shlex.join(warm)} "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    return program.parent


def at(home, *line, **variables):
    path = f"{home}:{environment()['PATH']}"
    return ran(*line, env=environment(HOME=str(home), PATH=path, **variables), cwd=home)


@pytest.mark.parametrize("shell", ["zsh", "fish", "powershell"])
@pytest.mark.parametrize("line", LINES)
def test_a_shell_is_told_how_the_last_word_goes_on(home, shell, line):
    asked = {"_ROBUST_COMPLETE": f"complete_{shell}", "_TYPER_COMPLETE_ARGS": line}
    asked |= {"_TYPER_COMPLETE_WORD_TO_COMPLETE": line.split()[-1], "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    ended = at(home, "robust", **asked)
    assert (ended.code, ended.err) == (0, "")
    assert LINES[line] in ended.out


def test_fish_learns_whether_there_is_anything_to_complete(home):
    asked = {"_ROBUST_COMPLETE": "complete_fish", "_TYPER_COMPLETE_FISH_ACTION": "is-args"}
    for line, code in (("robust envel", 0), ("robust nothing", 1)):
        assert at(home, "robust", _TYPER_COMPLETE_ARGS=line, **asked).code == code


@pytest.mark.parametrize("shell", ["bash", "fish", "zsh", "pwsh"])
def test_shells_have_a_script_by_which_those_installed_complete(home, shell):
    shown = at(home, "robust", "--show-completion", shell, _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")
    assert shown.code == 0
    assert "_ROBUST_COMPLETE" in shown.out
    if shell in SHELLS and shutil.which(shell):
        script = home / f"completion.{shell}"
        script.write_text(shown.out, encoding="utf-8")
        for line, word in LINES.items():
            ended = at(home, *SHELLS[shell], script, line)
            assert (ended.err, word in ended.out) == ("", True), line
