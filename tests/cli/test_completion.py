"""Completion: what each of four shells is given; those which are installed complete commands, options and values."""

import shlex
import shutil
import subprocess

import pytest

from tests.cli.running import environment

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


@pytest.fixture(scope="module")
def home(tmp_path_factory, warm):
    """A home directory, with the command `robust` in it."""
    directory = tmp_path_factory.mktemp("home")
    command = directory / "robust"
    command.write_text(f'#!/bin/sh\nexec {shlex.join(warm)} "$@"\n', encoding="utf-8")
    command.chmod(0o755)
    return directory


def run(home, *words, **more):
    settings = {**environment(), "HOME": str(home), **more}
    settings["PATH"] = f"{home}:{settings['PATH']}"
    return subprocess.run(words, env=settings, capture_output=True, text=True, check=False, cwd=home, timeout=60)


@pytest.mark.parametrize("shell", ["zsh", "fish", "powershell"])
@pytest.mark.parametrize("line", LINES)
def test_a_shell_is_told_how_the_last_word_goes_on(home, shell, line):
    asked = {"_ROBUST_COMPLETE": f"complete_{shell}", "_TYPER_COMPLETE_ARGS": line}
    asked |= {"_TYPER_COMPLETE_WORD_TO_COMPLETE": line.split()[-1], "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    ended = run(home, "robust", **asked)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert LINES[line] in ended.stdout


@pytest.mark.parametrize(("line", "code"), [("robust envel", 0), ("robust nothing", 1)])
def test_fish_learns_whether_there_is_anything_to_complete(home, line, code):
    asked = {"_ROBUST_COMPLETE": "complete_fish", "_TYPER_COMPLETE_FISH_ACTION": "is-args"}
    assert run(home, "robust", _TYPER_COMPLETE_ARGS=line, **asked).returncode == code


@pytest.mark.parametrize("shell", [shell for shell in SHELLS if shutil.which(shell)])
@pytest.mark.parametrize("line", LINES)
def test_installed_shells_complete(home, shell, line):
    script = home / f"completion.{shell}"
    shown = run(home, "robust", "--show-completion", shell, _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")
    assert shown.returncode == 0
    script.write_text(shown.stdout, encoding="utf-8")
    ended = run(home, *SHELLS[shell], str(script), line)
    assert ended.stderr == ""
    assert LINES[line] in ended.stdout


@pytest.mark.parametrize("shell", ["zsh", "pwsh"])
def test_other_shells_have_a_script(home, shell):
    shown = run(home, "robust", "--show-completion", shell, _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")
    assert shown.returncode == 0
    assert "_ROBUST_COMPLETE" in shown.stdout
