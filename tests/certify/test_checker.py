"""The checker: small, alone, bounded, and strict about everything that a certificate may say."""

import ast
import gzip
import subprocess
import sys
import time
from fractions import Fraction

import pytest

from robust.certify.verify import checker_path
from robust.qe.box import Interval
from tests.certify import tools

HEADER = {"format": "robust/certificate/1", "kind": "knowledge", "inputs": {}}
FALSE = [["g", []], ["obligation", "correct execution"], ["root", -1, "t"], ["qed", [[1, 0], 0]], ["end"]]


def written(tmp_path, *lines, header=HEADER):
    path = tmp_path / "made.cert"
    tools.write_lines(path, [header, *lines])
    return path


def rejected(tmp_path, *lines, header=HEADER):
    return tools.rejection(written(tmp_path, *lines, header=header))


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
    path = written(tmp_path, *FALSE)
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
    assert (
        rejected(tmp_path, ["a", [[10**5000, "x"]], False]) is not None if sys.get_int_max_str_digits() > 5001 else True
    )
    path.write_bytes(gzip.compress(b'{"format":' * 20000 + b"\n"))
    assert tools.rejection(path) is not None
    path.write_bytes(gzip.compress(b'{"n":' + b"9" * 100000 + b"}\n"))
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
def maximal(tmp_path_factory):
    path = tmp_path_factory.mktemp("certificates") / "maximal.cert"
    plan, box = tools.certificate(tools.NAVIGATION, path, kind="maximal")
    return plan, box, tools.lines_of(path)


def test_a_plan_may_not_change_after_something_was_concluded_from_it(maximal, tmp_path):
    _, _, lines = maximal
    place = next(index for index, line in enumerate(lines) if isinstance(line, list) and line[0] == "schedule")
    constraint = next(line for line in lines[1:] if line[0] == "constraint")
    assert rejected(tmp_path, *lines[1:], header=lines[0]) is None
    assert (
        rejected(tmp_path, *lines[1:place], lines[place], constraint, *lines[place + 1 :], header=lines[0]) is not None
    )


@pytest.mark.parametrize("kind", ["witness", "cycle", "schedule", "obligation", "folded"])
def test_nothing_may_be_missing(maximal, tmp_path, kind):
    _, _, lines = maximal
    places = [index for index, line in enumerate(lines) if isinstance(line, list) and line[0] == kind]
    for place in places:
        end = place + 1
        while kind == "obligation" and lines[end - 1][0] != "qed":
            end += 1
        assert rejected(tmp_path, *lines[1:place], *lines[end:], header=lines[0]) is not None


def test_faces_may_not_move(maximal, tmp_path):
    _, _, lines = maximal
    for number, ends in enumerate(lines[0]["box"]):
        for side in (0, 2):
            for step in (Fraction(-1, 1000), Fraction(1, 1000)):
                if ends[side] is not None:
                    moved = [list(each) for each in lines[0]["box"]]
                    moved[number][side] = str(Fraction(ends[side]) + step)
                    assert rejected(tmp_path, *lines[1:], header={**lines[0], "box": moved}) is not None


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


REGION = {"format": "robust/certificate/1", "kind": "region", "inputs": {}, "encoding": "relational", "parameters": []}
SCHEDULED = [["piece", []], ["schedule", [[]], [[]]]]


def test_a_region_must_say_what_is_outside(tmp_path):
    rest = [["rest"], ["g", []], ["obligation", "the rest"], ["root", -1, "o", 0], ["qed", [[1, 0], 0]], ["end"]]
    assert rejected(tmp_path, *SCHEDULED, *rest, header=REGION) is None
    assert rejected(tmp_path, *SCHEDULED, ["end"], header=REGION) is not None
    assert rejected(tmp_path, SCHEDULED[0], *rest, header=REGION) is not None
    assert rejected(tmp_path, *SCHEDULED, ["outside", []], *rest, header=REGION) is not None
    for role in (["t"], ["o", 1], ["z", 0], ["x", [["t"]]]):
        changed = [*rest[:3], ["root", -1, *role], *rest[4:]]
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
    rest = [["rest"], ["g", []], ["obligation", "the rest"], ["root", -1, "o", 0], ["qed", [[1, 0], 0]], ["end"]]
    header = {**REGION, "epsilon": "1/1000"}
    assert rejected(tmp_path, *plan, ["apart", 1, 2], *piece, *rest, header=header) is None
    assert "no separation" in rejected(tmp_path, *plan, *piece, *rest, header=header)
    assert rejected(tmp_path, *plan, ["apart", 2, 1], *piece, *rest, header=header) is not None
    assert rejected(tmp_path, *plan, ["apart", 1, 2], *piece, *rest, header={**header, "epsilon": 2}) is not None
