"""Where answers are printed: colours only where they are wanted, and nothing is cut where there is little room."""

import re
from collections import Counter
from io import StringIO

import hypothesis
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.show.console import console
from robust.show.tables import show_table, table
from tests.cli.running import EXAMPLES, command, example, process

KITCHEN = str(EXAMPLES / "kitchen" / "kitchen.tpnu.json")
WAITING = example("plan-flexible-wait.stn")
DRAWN = ("--distribution", "to_ridge=normal:30:4", "--distribution", "to_crater=normal:40:3", "--within", "0.01")
COMMANDS = {
    "check": (*WAITING, "--all"),
    "envelope": example(),
    "region": example(),
    "compare": example(),
    "risk": (*example(), *DRAWN),
    "repair": WAITING,
    "validate": example("steps.plan"),
    "convert": (*example("steps.plan"), "-o", "made.stn"),
    "execute": (*example(), "--seed", "4"),
    "certify": (*example(), "-o", "plan.cert"),
    "verify": ("plan.cert", *example()),
    "demo": (),
    "pike check": (KITCHEN, "--all-scenarios", "--backend", "pitms"),
    "pike compile": (KITCHEN,),
    "pike run": (KITCHEN, "--backend", "smt", "--explain"),
    "pike plot": (KITCHEN, "-o", "kitchen.svg"),
    "pike new": ("kitchen", "-o", "."),
    "pike region": (KITCHEN, "--parameter", "coffee=duration:make-coffee"),
    "pike envelope": (KITCHEN, "--parameter", "coffee=duration:make-coffee"),
    "stnu check": (str(EXAMPLES / "handover" / "handover.stnu"),),
    "stnu dispatch": (str(EXAMPLES / "handover" / "handover.stnu"),),
    "stnu repair": (str(EXAMPLES / "handover" / "handover.stnu"),),
}


def words(text: str) -> Counter[str]:
    """Words as often as they occur, without rules, and without what varies: times, and what searches come across."""
    varies = r"─+|[0-9.]+ m?s\b[,.]?|[0-9]+ (?:checks?|cells?|plans?|polyhedra|points)\b[,.]?"
    return Counter(re.sub(varies, " ", " ".join(text.split())).split())


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    return tmp_path_factory.mktemp("narrow")


@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_cut_at_60_columns(name, directory, monkeypatch):
    monkeypatch.chdir(directory)
    asked = (*name.split(), *COMMANDS[name], *(("--force",) if name == "pike new" else ()))

    def printed(columns):
        monkeypatch.setenv("COLUMNS", columns)
        # Of several obligations that end a side of the demo's boxes, a solver that was asked before may name another.
        return process(*asked, COLUMNS=columns) if name == "demo" else command(*asked)

    wide, narrow = printed("200"), printed("60")
    assert narrow.code == wide.code
    assert narrow.out
    lines = [line for line in narrow.out.splitlines() if len(line) > 60]
    assert not [line for line in lines if " " in line.strip()], lines  # a path has no place to be broken at
    lost = words(wide.out) - words(narrow.out)
    assert not {word for word in lost if len(word) < 50}, lost


@given(st.lists(st.tuples(*[st.text("abc (,)", max_size=20)] * 4), min_size=1, max_size=5), st.integers(40, 120))
@hypothesis.example([("a" * 8, "", "a" * 6, " " + "a" * 9)], 40)
def test_tables_keep_every_word(rows, width):
    printed = StringIO()
    show_table(console(printed, width=width), table(("first", "second", "third", "fourth"), rows, right=("second",)))
    found = Counter(re.sub("─+", " ", printed.getvalue()).split())
    assert not Counter(" ".join(cell for row in rows for cell in row).split()) - found - _stuck(found)
    assert all(len(line) <= width or " " not in line.strip() for line in printed.getvalue().splitlines())


def _stuck(found: Counter[str]) -> Counter[str]:
    """Words to which what joins the lines of a cell sticks."""
    return Counter({word.rstrip(","): count for word, count in found.items()})


@pytest.mark.parametrize(
    ("option", "environment", "colored"),
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
def test_colors_are_where_they_are_wanted(option, environment, colored, monkeypatch):
    for name in ("NO_COLOR", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    ended = command("check", *WAITING, *option, "--quiet")
    assert ended.code == 1
    assert ("\x1b[1;31m" in ended.out) == colored
    answer = command("check", *WAITING, *option, "--json")
    assert "\x1b" not in answer.out


def test_colors_that_do_not_exist_are_one_line():
    ended = command("check", *WAITING, "--color", "green")
    assert (ended.code, ended.out) == (2, "")
    assert "--color" in ended.err
    assert ended.err.count("\n") == 1
