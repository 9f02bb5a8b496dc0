"""Results show themselves as their commands do: as text, for notebooks, as JSON, as tables and as pictures."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import robust
from robust import pike, stnu
from robust.draw.pictures import picture
from robust.errors import InputError
from robust.show import presenting
from robust.show.console import printing
from robust.show.documents import documenting
from tests.cli.running import EXAMPLES, command, example
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
    """A command line, the same from Python, and what only the command knows: keys of its answer."""

    words: tuple[str, ...]
    ask: Callable[[], Any]
    only: frozenset[str] = frozenset()
    says: bool = True
    """Whether both say the same to people."""


CASES = {
    "check": Case(("check", *example()), lambda: robust.check(example())),
    "check all": Case(("check", *example(), "--all"), lambda: robust.check(example(), every=True)),
    "check refuted": Case(("check", *FLEXIBLE), lambda: robust.check(FLEXIBLE), frozenset({"repair"}), says=False),
    "check delivery": Case(("check", *DELIVERY), lambda: robust.check(DELIVERY), frozenset({"notes"})),
    "check positions": Case(
        ("check", *GENERATOR, "--encoding", "positions", "--epsilon", "0.01"),
        lambda: robust.check(GENERATOR, encoding="positions", epsilon=0.01),
    ),
    "envelope": Case(("envelope", *example()), lambda: robust.envelope(example())),
    "envelope irr": Case(
        ("envelope", *example(), "--method", "irr", "--doubling"),
        lambda: robust.envelope(example(), method="irr", doubling=True),
    ),
    "envelope optimal": Case(
        ("envelope", *example(), "--method", "optimal"), lambda: robust.envelope(example(), method="optimal")
    ),
    "envelope generator": Case(("envelope", *GENERATOR), lambda: robust.envelope(GENERATOR)),
    "envelope delivery": Case(("envelope", *DELIVERY), lambda: robust.envelope(DELIVERY), frozenset({"notes"})),
    "envelope invalid": Case(
        ("envelope", *FLEXIBLE), lambda: robust.envelope(FLEXIBLE), frozenset({"counterexample"}), says=False
    ),
    "envelope controllable": Case(
        ("envelope", *example(), "--controllability", "weak", "--quiet"),
        lambda: robust.envelope(example()),
        frozenset({"controllability"}),
        says=False,
    ),
    "region": Case(("region", *example()), lambda: robust.region(example())),
    "region generator": Case(
        ("region", *GENERATOR),
        lambda: robust.region(GENERATOR),
        frozenset({"factors"}),  # of which some constraints may follow from the others
    ),
    "compare": Case(("compare", *example()), lambda: robust.compare(example())),
    "repair": Case(("repair", *FLEXIBLE), lambda: robust.repair(FLEXIBLE)),
    "risk": Case(
        ("risk", *example(), *DRAWN, "--within", "0.01"), lambda: robust.risk(example(), RANDOM, within="0.01")
    ),
    "validate": Case(("validate", *STEPS), lambda: robust.validate(*STEPS), frozenset({"domain", "problem"})),
    "convert": Case(("convert", *STEPS), lambda: robust.convert(*STEPS), frozenset({"notes"}), says=False),
    "batch check": Case(
        ("batch", "check", str(EXAMPLES / "two_sample_navigation")),
        lambda: robust.batch("check", EXAMPLES / "two_sample_navigation"),
        says=False,  # seconds in a column of their own
    ),
    "stnu check": Case(("stnu", "check", HANDOVER), lambda: stnu.check(HANDOVER)),
    "stnu dispatch": Case(("stnu", "dispatch", HANDOVER, "--runs", "0"), lambda: stnu.dispatch(HANDOVER)),
    "stnu repair": Case(("stnu", "repair", HANDOVER), lambda: stnu.repair(HANDOVER)),
    "pike check": Case(
        ("pike", "check", KITCHEN, "--backend", "pitms", "--all-scenarios"),
        lambda: pike.check(KITCHEN, backend="pitms", all_scenarios=True),
    ),
    "pike compile": Case(("pike", "compile", WING), lambda: pike.compile(WING)),
    "pike moments": Case(("pike", "check", KITCHEN, "--patience"), lambda: pike.moments(KITCHEN)),
    "pike run": Case(
        ("pike", "run", KITCHEN, "--seed", "3", "--outcome", "xA1=mug@2"),
        lambda: pike.run(KITCHEN, seed=3, outcome={"xA1": ("mug", 2)}),
        says=False,  # how long decisions took
    ),
    "pike region": Case(
        ("pike", "region", KITCHEN, "--parameter", COFFEE, "--parameter", LIMIT),
        lambda: pike.region(KITCHEN, [COFFEE, LIMIT]),
    ),
    "pike envelope": Case(
        ("pike", "envelope", KITCHEN, "--parameter", COFFEE, "--parameter", LIMIT, "--for-all", "xA1"),
        lambda: pike.envelope(KITCHEN, [COFFEE, LIMIT], for_all="xA1"),
    ),
    "pike cross": Case(("pike", "check", NETWORK, "--cross"), lambda: pike.cross_check(NETWORK)),
}
MEASURED = re.compile(r"seconds$|_s$|^statistics$|^queries$|^convergence$|^checks$|^pieces$|_mb$")


@cache
def result(name: str) -> Any:
    return CASES[name].ask()


def comparable(value: Any, left_out: frozenset[str]) -> Any:
    """Without what is measured, and what only the command knows."""
    if isinstance(value, dict):
        kept = {key: one for key, one in value.items() if not MEASURED.search(key) and key not in left_out}
        return {key: comparable(one, left_out) for key, one in kept.items()}
    return [comparable(one, left_out) for one in value] if isinstance(value, list) else value


@pytest.mark.parametrize("name", CASES)
def test_a_result_as_dictionary_is_what_its_command_prints_for_programs(name):
    case = CASES[name]
    printed = json.loads(command(*case.words, "--json").out)
    found = result(name).as_dict()
    assert comparable(found, case.only) == comparable(printed, case.only)
    assert found == json.loads(json.dumps(found))
    extra = {"notes", "controllability"} & case.only
    assert found.keys() == printed.keys() - extra


@pytest.mark.parametrize("name", CASES)
def test_a_result_as_text_is_what_its_command_prints_for_people(name, monkeypatch):
    case = CASES[name]
    text = str(result(name))
    assert len(text.splitlines()) <= presenting.SCREEN
    assert "\x1b" not in text
    if not case.says:
        return
    monkeypatch.setenv("COLUMNS", "100")
    printed = command(*case.words).out.rstrip("\n").splitlines()
    lines = text.splitlines()
    if len(printed) > presenting.SCREEN:
        assert lines.pop().startswith(f"... and {len(printed) - presenting.SCREEN + 1} more lines")
    if name == "validate":  # which says how options are called in Python
        return
    assert [timeless(line) for line in lines] == [timeless(line) for line in printed[: len(lines)]]


def timeless(line: str) -> str:
    return " ".join(re.sub(r"[0-9.]+ m?s\b|─+|[0-9]+ (?:checks?|polyhedr(?:a|on))", "#", line).split())


@pytest.mark.parametrize(
    ("asked", "promise"),
    [
        ({}, "no valid box contains this one"),
        ({"method": "irr", "beta": "1/2"}, "no end can move outwards by 0.5 or more"),
        ({"method": "irr", "doubling": True}, "no end can move outwards by 2 or more"),
        ({"method": "optimal"}, "no box in the envelope is wider"),
        ({"method": "optimal", "contain_nominal": True}, "no box around the nominal values is wider"),
    ],
)
def test_boxes_say_what_they_are(asked, promise):
    assert f"complete: {promise}" in str(robust.envelope(example(), **asked))


class Tags(HTMLParser):
    """Finds out whether all that is begun is ended, and collects the texts."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.text = ""

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.open.append(tag)
        self.seen.add(tag)

    def handle_startendtag(self, tag: str, attrs: object) -> None:
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def parsed(page: str) -> Tags:
    found = Tags()
    found.feed(page)
    found.close()
    assert not found.open
    return found


@pytest.mark.parametrize("name", CASES)
def test_a_result_in_a_notebook_is_well_formed_and_says_the_same(name):
    page = parsed(result(name)._repr_html_())
    assert page.seen <= {"div", "pre", "span", "table", "thead", "tbody", "tr", "th", "td", "br"}
    first = str(result(name)).split(maxsplit=1)[0]
    assert first in page.text


@pytest.mark.parametrize("name", ["envelope", "compare", "check refuted", "risk"])
def test_tables_are_tables_in_a_notebook(name):
    assert "table" in parsed(result(name)._repr_html_()).seen


def test_texts_of_files_are_escaped():
    nasty = "<script>alert('&')</script>\x07"
    found = result("check refuted")
    broken = next(iter(found.counterexamples.values()))
    violations = tuple(replace(one, detail=nasty) for one in broken.simulation.violations)
    changed = replace(broken, simulation=replace(broken.simulation, violations=violations))
    page = replace(found, counterexamples={broken.obligation: changed})._repr_html_()
    assert parsed(page).seen <= {"div", "pre", "span", "table", "thead", "tbody", "tr", "th", "td", "br"}
    assert "&lt;script&gt;" in page
    assert "\x07" not in page
    unread = replace(result("envelope invalid"), reason=nasty)._repr_html_()
    assert "<script>" not in unread


WITHOUT_TABLE = ("pike compile",)


@pytest.mark.parametrize("name", CASES)
def test_tables_have_the_same_columns_in_each_row(name):
    if name in WITHOUT_TABLE:
        with pytest.raises(InputError, match="without a table"):
            result(name).rows()
        return
    rows = result(name).rows()
    assert isinstance(rows, list)
    assert len({tuple(row) for row in rows}) <= 1 or name.startswith("pike")
    for row in rows:
        assert not any(isinstance(value, dict) for value in row.values())


def test_tables_have_numbers():
    rows = result("envelope").rows()
    assert [(row["parameter"], row["nominal"], row["lower"], row["upper"]) for row in rows] == [
        ("to_ridge", 30.0, 25.0, 36.0),
        ("to_crater", 40.0, 35.0, 46.0),
    ]
    assert {row["upper"] for row in result("envelope generator").rows()} <= {float("inf"), *map(float, range(10**4))}
    constraints = result("region").rows()
    assert {"piece": 0, "removed": False, "to_crater": 1.0, "to_ridge": 1.0, "relation": "<=", "constant": 85.0} in (
        constraints
    )


def test_tables_are_data_frames_in_one_call():
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(result("envelope").rows())
    assert list(frame.parameter) == ["to_ridge", "to_crater"]
    assert frame.lower.dtype == float


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


def test_every_kind_of_result_is_tried():
    kinds = {type(result(name)) for name in CASES}
    for registry in (printing.registry, documenting.registry):
        assert kinds == registry.keys() - {object}
    assert {kind.__module__.removeprefix("robust.") for kind in kinds} == presenting._SHOWN_BY.keys()


def test_results_cost_nothing_but_themselves(tmp_path):
    """What shows a result is loaded when it is shown."""
    import subprocess  # noqa: PLC0415
    import sys  # noqa: PLC0415

    loaded = "[name for name in sys.modules if name[7:11] in ('show', 'draw')]"
    code = f"import robust, sys; robust.check({example()!r}); print({loaded})"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
    assert Path(tmp_path).exists()
