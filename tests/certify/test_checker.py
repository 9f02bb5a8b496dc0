"""The checker: small, alone, bounded in time and memory, and strict about everything that a certificate may say."""

import ast
import gzip
import json
import os
import subprocess
import sys
import time
from fractions import Fraction
from itertools import chain, count, cycle, product, repeat
from subprocess import PIPE, STDOUT

import pytest

from robust.certify.verify import checker_path
from robust.qe.box import Interval
from tests.certify import tools

HEADER = {"format": "robust/certificate/1", "kind": "knowledge", "inputs": {}}
REGION = {**HEADER, "kind": "region", "encoding": "relational", "parameters": []}
FALSE = [["g", []], ["obligation", "correct execution"], ["root", -1, "t"], ["qed", [[1, 0], 0]], ["end"]]


def rejected(tmp_path, *lines, header=HEADER):
    tools.write_lines(tmp_path / "made.cert", [header, *lines])
    return tools.rejection(tmp_path / "made.cert")


def test_it_is_one_short_file_that_needs_the_standard_library_only():
    text = checker_path().read_text(encoding="utf-8")
    assert len(text.splitlines()) < 600
    imported = {
        (node.names[0].name if isinstance(node, ast.Import) else node.module).split(".")[0]
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Import | ast.ImportFrom)
    }
    assert imported <= sys.stdlib_module_names


def test_it_runs_alone(tmp_path):
    path = tmp_path / "made.cert"
    tools.write_lines(path, [HEADER, *FALSE])
    words = [sys.executable, "-I", str(checker_path()), str(path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("established: the formula of the certificate has no model\n")
    wrong = (([*words, "--network", str(path)], 1), ([*words, "--network", "/no"], 2), ([*words[:-1], "/no"], 2))
    for others, code in wrong:
        assert subprocess.run(others, capture_output=True, check=False).returncode == code


@pytest.mark.parametrize(
    "lines",
    [
        FALSE[:-1],
        FALSE[1:],
        [*FALSE, ["end"]],
        [FALSE[0], FALSE[4]],
        [["a", [[1, "boolean p"]], True], *FALSE[1:]],
        [["g", [1]], *FALSE[1:]],
        [["g", []], FALSE[1], ["root", 1, "t"], *FALSE[3:]],
        [["a", [[1, "x"]], False], ["lemma", [-1], [1]], FALSE[1], ["root", 1, "t"], ["qed", [-1, 0]], FALSE[4]],
        [["a", [[1, ""]], False], FALSE[4]],
        [["a", [[1, "x"], [1, "x"]], False], FALSE[4]],
        [["a", [[1, "x", "y"]], False], FALSE[4]],
        [["a", [["1/0", "x"]], False], FALSE[4]],
        [["a", [[1.5, "x"]], False], FALSE[4]],
        [["a", [[float("inf"), "x"]], False], FALSE[4]],
    ],
)
def test_what_does_not_follow_is_rejected(tmp_path, lines):
    assert rejected(tmp_path, *FALSE) is None
    assert rejected(tmp_path, *lines) is not None


def test_multipliers_must_be_positive_and_add_up(tmp_path):
    atoms = [["a", [[1, "x"]], False], ["a", [[-1, "x"], [-1]], False]]  # x ≥ 0 and −x − 1 ≥ 0
    rest = [FALSE[1], ["root", 1, "t"], ["root", 2, "t"], ["qed", [0, 1, -1]], FALSE[4]]
    assert rejected(tmp_path, *atoms, ["lemma", [-1, -2], [1, 1]], *rest) is None
    for multipliers in ([1, 2], [-1, -1], [0, 1], [1], [1, 1, 1], [True, 1], ["1", 1]):
        assert rejected(tmp_path, *atoms, ["lemma", [-1, -2], multipliers], *rest) is not None
    assert rejected(tmp_path, *atoms, ["lemma", [1, 2], [1, 1]], *rest) is not None


def test_bombs_are_refused_in_time_and_memory(tmp_path):
    path = tmp_path / "bomb.cert"
    path.write_bytes(gzip.compress(b"[" * (64 << 20), compresslevel=1))
    started = time.perf_counter()
    assert tools.rejection(path) is not None
    assert sys.get_int_max_str_digits() <= 5001 or rejected(tmp_path, ["a", [[10**5000, "x"]], False]) is not None
    for text in (b'{"format":' * 20000 + b"\n", b'{"n":' + b"9" * 100000 + b"}\n"):
        path.write_bytes(gzip.compress(text))
        assert tools.rejection(path) is not None
    assert time.perf_counter() - started < 20


def test_work_is_limited_by_the_size(tmp_path):
    """One long clause that every hint names again."""
    count = 4000
    lines = [["a", [[1, str(number)]], True] for number in range(count)]
    lines += [["g", list(range(1, count + 1))], FALSE[1], ["root", count + 1, "t"]]
    lines += [["derive", [1], [[count + 1, 0]] * 30000]]
    started = time.perf_counter()
    assert rejected(tmp_path, *lines) is not None
    assert time.perf_counter() - started < 20


@pytest.fixture(scope="module")
def certified(tmp_path_factory):
    """The lines of certificates of a maximal box and of a region."""
    path = tmp_path_factory.mktemp("certificates") / "made.cert"
    found = {}
    for kind in ("maximal", "region"):
        tools.certificate(tools.NAVIGATION, path, kind=kind)
        found[kind] = tools.lines_of(path)
    return found


def test_a_plan_may_not_change_after_something_was_concluded_from_it(certified, tmp_path):
    header, *lines = certified["maximal"]
    place = next(index for index, line in enumerate(lines) if line[0] == "schedule") + 1
    constraint = next(line for line in lines if line[0] == "constraint")
    assert rejected(tmp_path, *lines, header=header) is None
    assert rejected(tmp_path, *lines[:place], constraint, *lines[place:], header=header) is not None


PARTS = ("piece", "outside", "rest")


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        *(("maximal", kind) for kind in ("witness", "schedule", "obligation", "folded")),
        *(("region", kind) for kind in (*PARTS, "schedule", "obligation")),
    ],
)
def test_nothing_may_be_missing(certified, tmp_path, given, kind):
    """A part of a region reaches to the next one, and an obligation to its refutation; nodes and lemmas are kept."""
    header, *lines = certified[given]
    places = [index for index, line in enumerate(lines) if line[0] == kind]
    assert places
    for place in places:
        end = place + 1
        while kind in PARTS and lines[end][0] not in (*PARTS, "end") and lines[end - 1][0] != "qed":
            end += 1
        while kind == "obligation" and lines[end - 1][0] != "qed":
            end += 1
        kept = [line for line in lines[place:end] if line[0] in ("a", "g", "lemma")]
        assert rejected(tmp_path, *lines[:place], *kept, *lines[end:], header=header) is not None


def test_faces_may_not_move(certified, tmp_path):
    header, *lines = certified["maximal"]
    steps = (Fraction(-1, 1000), Fraction(1, 1000))
    for (number, ends), side, step in product(enumerate(header["box"]), (0, 2), steps):
        if ends[side] is not None:
            moved = [list(each) for each in header["box"]]
            moved[number][side] = str(Fraction(ends[side]) + step)
            assert rejected(tmp_path, *lines, header={**header, "box": moved}) is not None


def test_open_boxes_have_witnesses_on_the_face(tmp_path):
    """Taking an end away from the box makes it smaller, so that it is not maximal any more."""
    path = tmp_path / "open.cert"
    _, box = tools.certificate(tools.GENERATOR, path, kind="maximal")
    name = next(iter(box.intervals))
    interval = box[name]
    smaller = box.replace(name, Interval(interval.lower, interval.some_value(), interval.lower_closed, True))
    tools.certificate(tools.GENERATOR, path, kind="box", box=smaller)
    assert tools.rejection(path) is None
    lines = tools.lines_of(path)
    assert rejected(tmp_path, *lines[1:], header={**lines[0], "kind": "maximal"}) is not None


SCHEDULED = [["piece", []], ["schedule", [[]], [[]]]]
REST = [["rest"], ["g", []], ["obligation", "the rest"], ["root", -1, "o", 0], ["qed", [[1, 0], 0]], ["end"]]


def test_a_region_must_say_what_is_outside(tmp_path):
    assert rejected(tmp_path, *SCHEDULED, *REST, header=REGION) is None
    assert rejected(tmp_path, *SCHEDULED, ["end"], header=REGION) is not None
    assert rejected(tmp_path, SCHEDULED[0], *REST, header=REGION) is not None
    assert rejected(tmp_path, *SCHEDULED, ["outside", []], *REST, header=REGION) is not None
    for role in (["t"], ["o", 1], ["z", 0], ["x", [["t"]]]):
        changed = [*REST[:3], ["root", -1, *role], *REST[4:]]
        assert rejected(tmp_path, *SCHEDULED, *changed, header=REGION) is not None


def test_sides_without_parameters_are_no_statement(tmp_path):
    lines = [["piece", [[[[5]], False]]], SCHEDULED[1], ["rest"], ["a", [[1, "x"]], False], ["g", [1]]]
    rest = [["obligation", "the rest"], ["root", -2, "o", 0], ["qed", [0]], ["end"]]
    assert rejected(tmp_path, *lines, *rest, header=REGION) is not None


def test_points_a_constant_time_apart(tmp_path):
    plan = [["point", "a"], ["point", "b"], ["constraint", 1, 2, [[1]]], ["constraint", 2, 1, [[-1]]]]
    plan += [["effect", 1, "add", "p", [], True], ["effect", 2, "delete", "p", [], True]]
    plan += [["place", 1, "t(a)"], ["place", 2, [0, 1]]]
    piece = [["piece", []], ["schedule", [[], [], [[1]]], [[], [], [], [], []]]]
    header = {**REGION, "epsilon": "1/1000"}
    assert rejected(tmp_path, *plan, ["apart", 1, 2], *piece, *REST, header=header) is None
    assert "no separation" in rejected(tmp_path, *plan, *piece, *REST, header=header)
    assert rejected(tmp_path, *plan, ["apart", 2, 1], *piece, *REST, header=header) is not None
    assert rejected(tmp_path, *plan, ["apart", 1, 2], *piece, *REST, header={**header, "epsilon": 2}) is not None


# -- memory, measured by the system, from outside ----------------------------------------------------------------------

MOST = 1 << 30  # bytes
LENGTH = 100 << 20  # bytes, of a greedy certificate
POLYHEDRA = {**REGION, "parameters": [["p", None, None]]}
LITERALS = [["a", [[1, "x"]], False], ["a", [[-1, "x"], [-1]], False]]
ABOUT_P = [["a", [[1, "p"]], False], ["a", [[-1, "p"], [-1]], False]]
POINTS = [["point", "start"], ["point", "end"]]
EMPTY = [
    ["outside", [[[[1, "p"]], False], [[[-1, "p"], [-1]], False]]],
    ["obligation", "none"],
    ["root", 1, "w", 0],
    ["root", 2, "w", 1],
    ["qed", [0, 1, -1]],
]

GREEDY = {
    "nodes": (HEADER, [], (["a", [[1, f"x{number}"]], True] for number in count())),
    "wide nodes": (HEADER, [], (["a", [[1, f"{n}x{k}"] for k in range(999)], True] for n in count())),
    "great numbers": (HEADER, [], (["a", [["9" * 4000 + f"/{number + 7}", "x"]], True] for number in count())),
    "conjunctions": (HEADER, LITERALS, repeat(["g", [1, -2] * 500])),
    "empty conjunctions": (HEADER, [], repeat(["g", []])),
    "lemmas": (HEADER, LITERALS, repeat(["lemma", [-1, -2], [1, 1]])),
    "clauses": (
        HEADER,
        [["g", []], ["obligation", "correct execution"], ["root", -1, "t"]],
        repeat(["derive", [1], [[1, 0], 0]]),
    ),
    "constraints": (POLYHEDRA, POINTS, (["constraint", 1, 2, [[number, "p"]]] for number in count(1))),
    "conditions": (POLYHEDRA, POINTS, (["condition", 1, None, ["h", f"a{number}", True], ""] for number in count())),
    "effects": (POLYHEDRA, POINTS, (["effect", 1, "add", f"a{number}", [], True] for number in count())),
    "rates": (POLYHEDRA, POINTS, (["rate", 1, 2, f"f{number}", [[1]]] for number in count())),
    "folded": (POLYHEDRA, POINTS, (["folded", f"o{number}"] for number in count())),
    "polyhedra": (POLYHEDRA, [*ABOUT_P, ["lemma", [-1, -2], [1, 1]]], cycle(EMPTY)),
}


def greedy(path, name, length=LENGTH):
    """A certificate that goes on for longer than the checker may remember."""
    header, lines, more = GREEDY[name]
    left = length
    with gzip.open(path, "wb", compresslevel=1) as file:
        for line in chain([header], lines, more):
            text = json.dumps(line, separators=(",", ":")).encode() + b"\n"
            left -= file.write(text)
            if left < 0:
                break


def checked(path):
    """What the checker says, with its exit code, and the greatest memory it had."""
    with subprocess.Popen([sys.executable, "-I", checker_path(), path], stdout=PIPE, stderr=STDOUT, text=True) as run:
        said = run.stdout.read()
        _, status, used = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
    return run.returncode, said, used.ru_maxrss * 1024


QUICK = ("conjunctions", "great numbers")
GIVEN = [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in GREEDY if name not in QUICK)]


@pytest.mark.parametrize("name", GIVEN)
def test_memory_is_bounded_whatever_is_stated(tmp_path, name):
    path = tmp_path / "greedy.cert"
    greedy(path, name)
    code, said, memory = checked(path)
    assert (code, said.count("\n")) == (1, 1), said
    assert "more work or memory than its size may need" in said
    assert memory < MOST


def test_the_system_ends_what_the_count_does_not(tmp_path):
    """With less memory than that, the certificate is rejected, too."""
    path = tmp_path / "greedy.cert"
    greedy(path, "nodes", length=10 << 20)
    limited = f"ulimit -v {60 << 10}; exec {sys.executable} -I {checker_path()} {path}"
    done = subprocess.run(["bash", "-c", limited], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "")
    assert "malformed (MemoryError)" in done.stdout
