"""What is there before anything is computed, what extras are for, whatever is wrong, and where answers are printed."""

import json
import re
import shlex
import shutil
import sys
from collections import Counter
from io import StringIO

import hypothesis
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robust
from robust.errors import UnsupportedError
from robust.show.console import console
from robust.show.tables import show_table, table
from tests.cli.running import COMMAND, EXAMPLES, Ended, assert_one_line, command, environment, example, process, ran

KITCHEN = str(EXAMPLES / "kitchen" / "kitchen.tpnu.json")
STEPS = example("steps.plan")
FLEXIBLE = example("plan-flexible-wait.stn")


def test_help_loads_little_and_nothing_heavy():
    """What takes time at the start is loading modules; seconds would depend on what else the machine does."""
    script = """
import sys
before = set(sys.modules)
from robust.cli import run
run(["--help"])
print(*sorted(set(sys.modules) - before), file=sys.stderr)
run(["--version"]), run(["check", "--help"]), run(["bench", "scaling", "--help"])
print(*{"pysmt", "z3", "cvc5", "sympy", "matplotlib", "rich"} & set(sys.modules), file=sys.stderr)
"""
    ended = ran(sys.executable, "-W", "error", "-c", script)
    first, heavy = ended.err.splitlines()
    loaded = first.split()
    assert (ended.code, heavy) == (0, "")
    assert "robust.cli" in loaded
    assert len([name for name in loaded if name.startswith("robust")]) < 30
    assert len(loaded) < 250


EXTRAS = ("matplotlib", "numpy", "networkx", "dd", "scipy", "dask", "unified_planning")
RANDOM = [f"--distribution={kind}" for kind in ("to_ridge=normal:30:5", "to_crater=constant:40")]
CORE = (
    ("check", *example()),
    ("envelope", *example()),
    ("region", *example(), "--latex"),
    ("risk", *example(), *RANDOM, "--within", "0.5"),
    ("validate", *STEPS),
    ("convert", *STEPS, "--parameter", "duration:drive"),
    ("pike", "check", KITCHEN),
    ("pike", "compile", KITCHEN),
    ("pike", "run", KITCHEN, "--explain", "--outcome", "xA1=mug"),
)
NEEDED = (
    (("envelope", *example(), "--plot", "box.svg"), "matplotlib", "plots"),
    (("pike", "plot", KITCHEN, "-o", "plan.svg"), "matplotlib", "plots"),
    (("pike", "compile", KITCHEN, "--backend", "bdd"), "dd", "bdd"),
    (("pike", "check", KITCHEN, "--cross"), "dd", "bdd"),
)


def test_the_core_needs_no_extra_and_what_needs_one_says_which(monkeypatch):
    lines = [[*words, "--quiet"] for words in CORE] + [words for words, *_ in NEEDED]
    script = f"""
import json, sys
sys.modules.update(dict.fromkeys({EXTRAS!r}))
from tests.cli.running import command
ended = [command(*words) for words in {lines!r}]
print(json.dumps([(each.code, each.out, each.err) for each in ended]))
"""
    ended = [Ended(*each) for each in json.loads(ran(sys.executable, "-c", script).out)]
    assert [each.code for each in ended] == [0] * len(CORE) + [4] * len(NEEDED), ended
    for refused, (_, package, extra) in zip(ended[len(CORE) :], NEEDED, strict=True):
        assert_one_line(refused, 4, f"found no {package}")
        assert f"pip install 'robust-plans[{extra}]'" in refused.err
    envelope = robust.envelope(example())
    for name in [name for name in sys.modules if name.startswith(("matplotlib", "robust.show."))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(UnsupportedError, match=r"found no matplotlib.*robust-plans\[plots\]"):
        envelope.plot()


def test_errors_are_one_line_and_the_traceback_is_on_request(monkeypatch):
    def fail(*_arguments, **_options):
        raise ZeroDivisionError("first\nsecond")

    assert_one_line(command("check", *example()[:2], "no\nplan.stn"))
    monkeypatch.setattr("robust.api.searching_check", fail)
    line = "robust: internal error: ZeroDivisionError: first second; please report this, with the output of --verbose\n"
    ended = command("check", *example())
    assert (ended.code, ended.err) == (3, line)
    verbose = command("check", *example(), "--verbose")
    assert (verbose.code, "Traceback" in verbose.err) == (3, True)
    assert verbose.err.splitlines()[-1].startswith("robust: internal error: ZeroDivisionError")


def redirected(stream, *words):
    return ran("sh", "-c", " ".join([*COMMAND, *words, stream]))


@pytest.mark.parametrize("words", [("check", *example()), ("check", *example(), "--json"), ("--help",)])
def test_an_answer_that_a_full_device_does_not_take_is_no_success(words):
    ended = redirected(">/dev/full", *words)
    by_us = "cannot write to standard output: no" if words != ("--help",) else "No"
    assert (ended.code, ended.err) == (2, f"robust: error: {by_us} space left on device\n")


SERVICES = [("watch", *example()), ("pike", "run", KITCHEN, "--stdio")]


@pytest.mark.parametrize("words", SERVICES)
def test_a_service_says_that_a_full_device_takes_no_answers(words):
    ended = redirected(">/dev/full", *words)
    assert (ended.code, ended.err) == (2, "robust: error: cannot write to standard output: no space left on device\n")


def test_closed_streams_and_streams_in_other_encodings():
    """Without stdout there is nobody to answer to; messages may get lost."""
    ended = redirected(">&-", "check", *example())
    assert ended.code == 2
    assert ended.err.startswith("robust: error: found standard output closed, expected somewhere to write")
    ended = redirected("2>&-", "check", "none", "none", "none")
    assert (ended.code, ended.out) == (2, "")
    for stream in ("2>&-", "2>/dev/full"):
        ended = redirected(stream, "check", *FLEXIBLE)
        assert (ended.code, ended.out[:7]) == (1, "refuted")
    ended = process("check", *FLEXIBLE, env={**environment(), "PYTHONIOENCODING": "ascii"})
    assert (ended.code, ended.err) == (1, "")
    assert "(charge scout) = 170" in ended.out


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
