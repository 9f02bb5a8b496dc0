"""Results show themselves as their commands do: as text, for notebooks, as JSON, as tables and as pictures."""

import json
import re
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import chdir
from dataclasses import replace
from functools import cache, partial
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy
import pytest

import robust
from robust import InputError, pike, stnu
from robust.draw.pictures import picture
from robust.execute.monitor import Outlook
from robust.show import console, documents, presenting
from tests.cli.running import EXAMPLES, command, environment, example, process, ran
from tests.recordings.recordings import INPUTS

FLEXIBLE = example("plan-flexible-wait.stn")
STEPS = example("steps.plan")
DELIVERY = example(directory=EXAMPLES / "delivery")
GENERATOR = example(directory=EXAMPLES / "generator")
KITCHEN, WING = (str(EXAMPLES / name / f"{name}.tpnu.json") for name in ("kitchen", "wing"))
NETWORK = str(INPUTS / "unsatisfiable" / "plan.tpnu.json")
HANDOVER = str(EXAMPLES / "handover" / "handover.stnu")
RANDOM = {"to_ridge": "normal:30:4", "to_crater": "normal:40:3"}
DRAWN = [word for name, kind in RANDOM.items() for word in ("--distribution", f"{name}={kind}")]
COFFEE = "coffee=duration:make-coffee"
LIMIT = "limit=at-most:e1:e44"


class Case(NamedTuple):
    """What is asked from Python, the same as a command line, and what only the command knows: keys of its answer."""

    ask: Callable[[], Any]
    words: tuple[str, ...]
    only: frozenset[str] = frozenset()
    says: bool = True
    """Whether both say the same to people."""


def case(ask, line, *given, only="", says=True, **options):
    """A function with arguments; a command line in which FILES stands for those that come first in the arguments."""
    files = given[0] if isinstance(given[0], list) else [str(given[0])]
    words = [part for word in line.split() for part in (files if word == "FILES" else [word])]
    return Case(partial(ask, *given, **options), tuple(words), frozenset(only.split()), says)


SUITE = INPUTS / "suite"
KITCHENS = f"FILES --parameter {COFFEE} --parameter {LIMIT}"
CASES = {
    "check": case(robust.check, "check FILES", example()),
    "check all": case(robust.check, "check FILES --all", example(), every=True),
    "check refuted": case(robust.check, "check FILES", FLEXIBLE, only="repair", says=False),
    "check delivery": case(robust.check, "check FILES", DELIVERY, only="notes"),
    "check positions": case(
        robust.check, "check FILES --encoding positions --epsilon 0.01", GENERATOR, encoding="positions", epsilon=0.01
    ),
    "envelope": case(robust.envelope, "envelope FILES", example()),
    "envelope irr": case(
        robust.envelope, "envelope FILES --method irr --doubling", example(), method="irr", doubling=True
    ),
    "envelope optimal": case(robust.envelope, "envelope FILES --method optimal", example(), method="optimal"),
    "envelope generator": case(robust.envelope, "envelope FILES", GENERATOR),
    "envelope delivery": case(robust.envelope, "envelope FILES", DELIVERY, only="notes"),
    "envelope invalid": case(robust.envelope, "envelope FILES", FLEXIBLE, only="counterexample", says=False),
    "envelope controllable": case(
        robust.envelope, "envelope FILES --controllability weak --quiet", example(), only="controllability", says=False
    ),
    "region": case(robust.region, "region FILES", example()),
    # Of its factors some constraints may follow from the others.
    "region generator": case(robust.region, "region FILES", GENERATOR, only="factors"),
    "compare": case(robust.compare, "compare FILES", example()),
    "rank": case(lambda files: robust.rank(*files[:2], files[2:]), "rank FILES", STEPS),
    "repair": case(robust.repair, "repair FILES", FLEXIBLE),
    "learn": case(robust.learn, "learn FILES", INPUTS / "runs.csv"),
    "risk": case(robust.risk, f"risk FILES {' '.join(DRAWN)} --within 0.01", example(), RANDOM, within="0.01"),
    "validate": case(lambda files: robust.validate(*files), "validate FILES", STEPS, only="domain problem"),
    "convert": case(lambda files: robust.convert(*files), "convert FILES", STEPS, only="notes", says=False),
    "batch check": case(partial(robust.batch, "check"), "batch check FILES", SUITE, says=False),  # seconds of each
    "stnu check": case(stnu.check, "stnu check FILES", HANDOVER),
    "stnu dispatch": case(stnu.dispatch, "stnu dispatch FILES --runs 0", HANDOVER),
    "stnu repair": case(stnu.repair, "stnu repair FILES", HANDOVER),
    "pike check": case(
        pike.check, "pike check FILES --backend pitms --all-scenarios", KITCHEN, backend="pitms", all_scenarios=True
    ),
    "pike compile": case(pike.compile, "pike compile FILES", WING),
    "pike chance": case(pike.chance, "pike chance FILES", KITCHEN),
    "pike controllable": case(pike.controllable, "pike check FILES --controllable", KITCHEN),
    "pike moments": case(pike.moments, "pike check FILES --patience", KITCHEN),
    # It says how long decisions took.
    "pike run": case(
        pike.run,
        "pike run FILES --seed 3 --outcome xA1=mug@2 --budget none",
        KITCHEN,
        seed=3,
        budget=None,
        outcome={"xA1": ("mug", 2)},
        says=False,
    ),
    "pike region": case(pike.region, f"pike region {KITCHENS}", KITCHEN, [COFFEE, LIMIT]),
    "pike envelope": case(
        pike.envelope, f"pike envelope {KITCHENS} --for-all xA1", KITCHEN, [COFFEE, LIMIT], for_all="xA1"
    ),
    "pike cross": case(pike.cross_check, "pike check FILES --cross", NETWORK),
}
MORE = {
    "check refuted all": ("check", *FLEXIBLE, "--all"),
    "execute": ("execute", *example(), "--seed", "4"),
    "certify": ("certify", *example(), "-o", "plan.cert"),
    "verify": ("verify", "plan.cert", *example()),
    "demo": ("demo",),
    "pike run explained": ("pike", "run", KITCHEN, "--backend", "smt", "--explain", "--budget", "none"),
    "pike plot": ("pike", "plot", KITCHEN, "-o", "kitchen.svg"),
    "pike new": ("pike", "new", "kitchen", "-o", ".", "--force"),
    "stnu dispatch with a run": ("stnu", "dispatch", HANDOVER),
}
"""Other command lines that print something."""
DIRECTORY = TemporaryDirectory()
MEASURED = re.compile(r"seconds$|_s$|^statistics$|^queries$|^convergence$|^checks$|^pieces$|_mb$")


@cache
def result(name):
    return CASES[name].ask()


def comparable(value, omitted):
    """Without what is measured, and what only the command knows."""
    if isinstance(value, dict):
        kept = {key: item for key, item in value.items() if not MEASURED.search(key) and key not in omitted}
        return {key: comparable(item, omitted) for key, item in kept.items()}
    return [comparable(item, omitted) for item in value] if isinstance(value, list) else value


@pytest.mark.parametrize("name", CASES)
def test_results_as_dictionaries_are_what_commands_print_for_programs_and_tables_have_the_same_columns(name):
    case = CASES[name]
    printed = json.loads(command(*case.words, "--json").out)
    found = result(name).as_dict()
    assert comparable(found, case.only) == comparable(printed, case.only)
    assert found == json.loads(json.dumps(found))
    extra = {"notes", "controllability"} & case.only
    assert found.keys() == printed.keys() - extra
    if name == "pike compile":
        with pytest.raises(InputError, match="without a table"):
            result(name).rows()
        return
    rows = result(name).rows()
    assert isinstance(rows, list)
    assert len({tuple(row) for row in rows}) <= 1 or name.startswith("pike")
    for row in rows:
        assert not any(isinstance(value, dict) for value in row.values())


@cache
def printed(name, columns):
    """What a command prints for people where there is so much room, in a directory that all have."""
    words = MORE[name] if name in MORE else CASES[name].words
    if name == "verify":
        printed("certify", columns)  # makes what is verified
    with pytest.MonkeyPatch.context() as patch, chdir(DIRECTORY.name):
        patch.setenv("COLUMNS", columns)
        # Of several obligations that end a side of the demo's boxes, a solver that was asked before may name another.
        return process(*words, env=environment(COLUMNS=columns)) if name == "demo" else command(*words)


@pytest.mark.parametrize("name", CASES)
def test_a_result_as_text_or_in_a_notebook_is_what_its_command_prints_for_people(name):
    text = str(result(name))
    lines, wanted = text.splitlines(), printed(name, "100").out.rstrip("\n").splitlines()
    assert len(lines) <= presenting.SCREEN
    assert "\x1b" not in text
    if CASES[name].says and len(wanted) > presenting.SCREEN:
        assert lines.pop().startswith(f"... and {len(wanted) - presenting.SCREEN + 1} more lines")
    if CASES[name].says and name != "validate":  # which says how options are called in Python
        assert [timeless(line) for line in lines] == [timeless(line) for line in wanted[: len(lines)]]
    tags, text = parsed(result(name)._repr_html_())
    assert tags <= PLAIN
    assert str(result(name)).split(maxsplit=1)[0] in text
    assert "table" in tags or name not in {"envelope", "compare", "check refuted", "risk"}


def timeless(line):
    return " ".join(re.sub(r"[0-9.]+ m?s\b|─+|[0-9]+ (?:checks?|polyhedr(?:a|on))", "#", line).split())


def words_of(text):
    """Words as often as they occur, without rules, and without what varies: times, and what searches come across."""
    varies = r"─+|[0-9.]+ m?s\b[,.]?|[0-9]+ (?:checks?|cells?|plans?|polyhedra|points)\b[,.]?"
    return Counter(re.sub(varies, " ", " ".join(text.split())).split())


@pytest.mark.parametrize("name", [name for name in (*CASES, *MORE) if name != "envelope delivery"])
def test_nothing_is_cut_at_60_columns(name):
    """The table that is left out is printed in parts at 100 columns, each with its heading."""
    wide, narrow = printed(name, "100"), printed(name, "60")
    assert (narrow.code, "…" in narrow.out) == (wide.code, False)
    assert narrow.out
    lines = [line for line in narrow.out.splitlines() if len(line) > 60]
    assert not [line for line in lines if " " in line.strip()], lines  # a path has no place to be broken at
    # Where no table has room, headings stand before each value, with a colon.
    lost = words_of(wide.out) - words_of(narrow.out) - words_of(narrow.out.replace(":", ""))
    assert not {word for word in lost if len(word) < 50}, lost


def parsed(page):
    """The tags of a page, all of which are ended, and its text."""
    root = ElementTree.fromstring(f"<page>{page}</page>")  # noqa: S314 - our own
    return {element.tag for element in root.iter()} - {"page"}, "".join(root.itertext())


PLAIN = {"div", "pre", "span", "table", "thead", "tbody", "tr", "th", "td", "br"}


def test_texts_of_files_are_escaped():
    nasty = "<script>alert('&')</script>\x07"
    refuted = result("check refuted")
    broken = next(iter(refuted.counterexamples.values()))
    violations = tuple(replace(violation, detail=nasty) for violation in broken.simulation.violations)
    changed = replace(broken, simulation=replace(broken.simulation, violations=violations))
    page = replace(refuted, counterexamples={broken.obligation: changed})._repr_html_()
    assert parsed(page)[0] <= PLAIN
    assert "&lt;script&gt;" in page
    assert "\x07" not in page
    assert "<script>" not in replace(result("envelope invalid"), reason=nasty)._repr_html_()


def test_tables_have_numbers_and_are_data_frames_in_one_call():
    rows = result("envelope").rows()
    assert numpy.array([row["lower"] for row in rows]).dtype == float
    assert len({tuple(row) for row in rows}) == 1, "a data frame has one set of columns"
    assert [(row["parameter"], row["nominal"], row["lower"], row["upper"]) for row in rows] == [
        ("to_ridge", 30.0, 25.0, 36.0),
        ("to_crater", 40.0, 35.0, 46.0),
    ]
    assert {row["upper"] for row in result("envelope generator").rows()} <= {float("inf"), *map(float, range(10**4))}
    constraints = result("region").rows()
    assert {"piece": 0, "removed": False, "to_crater": 1.0, "to_ridge": 1.0, "relation": "<=", "constant": 85.0} in (
        constraints
    )


DRAWABLE = ("envelope", "envelope irr", "region", "compare", "risk", "pike run", "pike region", "pike envelope")


@pytest.mark.parametrize("name", CASES)
def test_pictures_are_figures_and_files(name, tmp_path):
    path = tmp_path / "picture.svg"
    if type(result(name)) not in picture.registry or name == "envelope invalid":
        with pytest.raises(InputError, match=r"plot: found .*, expected "):
            result(name).plot(path)
        assert not path.exists()
        assert name not in DRAWABLE
        return
    figure = result(name).plot(path)
    assert type(figure).__name__ == "Figure"
    assert path.read_bytes().startswith(b"<?xml")
    assert type(result(name).plot()).__name__ == "Figure"


@pytest.mark.parametrize(
    ("path", "axes", "says"),
    [
        ("picture.gif", (), "path: found 'picture.gif', expected a name that ends in .svg, .png, .pdf"),
        (None, "to_moon", "axes: found unknown parameter 'to_moon'"),
        (None, 3, "axes: found '3', expected texts"),
    ],
)
def test_wrong_pictures_are_refused(path, axes, says):
    with pytest.raises(InputError, match=re.escape(says)):
        result("region").plot(path, axes=axes)


def test_every_kind_of_result_is_tried_and_costs_nothing_but_itself():
    """What shows a result is loaded when it is shown."""
    # Outlook: a command that answers line by line, see tests/execute/test_monitor.py.
    kinds = {type(result(name)) for name in CASES} | {Outlook}
    for registry in (console.printing.registry, documents.documenting.registry):
        assert kinds == registry.keys() - {object}
    assert {kind.__module__.removeprefix("robust.") for kind in kinds} == presenting._SHOWN_BY.keys()
    loaded = "[name for name in sys.modules if name[7:11] in ('show', 'draw')]"
    ended = ran(sys.executable, "-c", f"import robust, sys; robust.check({example()!r}); print({loaded})")
    assert ended.out == "[]\n"
