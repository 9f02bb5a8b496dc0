"""The checker: what it says, what it needs, and forgeries of every class that once was accepted."""

from __future__ import annotations

import ast
import gzip
import io
import json
import os
import shutil
import subprocess
import sys
import tokenize

import pytest

from robust.api import envelope
from robust.certify.tape import write
from robust.certify.verify import FOLDER, CheckerOutcome, verify
from robust.plan.load import load_plan
from robust.qe.box import Interval
from tests.certify import tools
from tests.certify.texts import random_texts

ALLOWED = {"argparse", "collections", "dataclasses", "fractions", "functools", "gzip", "hashlib", "itertools", "json"}
ALLOWED |= {"math", "pathlib", "re", "resource", "signal", "sys", "tomllib", "typing", "zlib"}


# -- the checker itself ----------------------------------------------------------------------------------------------


def test_it_is_short_and_needs_the_standard_library_only():
    total = 0
    for path in FOLDER.glob("*.py"):
        text = path.read_text(encoding="utf-8")
        total += len(lines_of_code(text))
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Import):
                assert {alias.name for alias in node.names} <= ALLOWED, path
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 1 or (node.module or "").split(".")[0] in ALLOWED, path
    assert 1_000 < total <= 1_500


def lines_of_code(text: str) -> set[int]:
    """The lines that are neither blank, nor comments, nor documentation."""
    words = tokenize.generate_tokens(io.StringIO(text).readline)
    silent = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    lines = {line for word in words if word.type not in silent for line in range(word.start[0], word.end[0] + 1)}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            lines -= {*range(node.lineno, (node.end_lineno or node.lineno) + 1)}
    return lines


@pytest.fixture(scope="module")
def box():
    """The certificate of a maximal box."""
    return tools.made(tools.NAVIGATION, "maximal")


@pytest.fixture(scope="module")
def region():
    return tools.made(tools.NAVIGATION, "region")


@pytest.fixture(scope="module")
def ground():
    return tools.grounded(tools.NAVIGATION)


def run_alone(words, folder, seed):
    variables = {**os.environ, "PYTHONPATH": "", "PYTHONHASHSEED": seed}
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=variables, capture_output=True, text=True, check=False
    )


def test_it_runs_from_a_copy_of_its_folder(box, tmp_path):
    """With any hash seed; nothing of this package is on its path."""
    write(box, tmp_path / "box.cert")
    shutil.copytree(FOLDER, tmp_path / "checker", ignore=shutil.ignore_patterns("__pycache__"))
    words = ["-m", "checker", "box.cert", *map(str, tools.NAVIGATION)]
    runs = [run_alone(words, tmp_path, seed) for seed in ("0", "1", "7")]
    assert [(run.returncode, run.stderr) for run in runs] == [(0, "")] * 3
    (said,) = {run.stdout for run in runs}
    assert said.startswith(
        "established: valid for every schedule, for all (to_ridge, to_crater) in [25, 36] x [35, 46]; no other valid "
        "box within the declared bounds contains this one, epsilon = 1/1000\nof domain: sha256 "
    )


def test_what_is_mutex_does_not_depend_on_the_seed_of_hashes(tmp_path):
    """The order of obligations is the tape's order."""
    script = (
        "import json, sys; sys.path.insert(0, sys.argv[1]); from checker.reader import ground, Unsupported; "
        "from checker.formulas import Formulas; from fractions import Fraction\n"
        "for texts in json.loads(sys.argv[2]):\n"
        "  try:\n"
        "    f = Formulas(ground(*texts), Fraction(1, 1000))\n"
        "    print([(label, make()) for label, make in f.obligations()], f.circuit.nodes)\n"
        "  except Unsupported as error: print(error)"
    )
    words = ["-c", script, str(FOLDER.parent), json.dumps([random_texts(seed) for seed in range(12)])]
    runs = [run_alone(words, tmp_path, seed) for seed in ("1", "2")]
    assert runs[0].stdout == runs[1].stdout
    assert [(run.returncode, len(run.stdout.splitlines())) for run in runs] == [(0, 12)] * 2


def test_it_says_what_was_demanded_and_of_which_format_a_certificate_is(box, tmp_path):
    path = tmp_path / "cert"
    assert "expected region" in tools.command(box, path, tools.NAVIGATION, kind="region")[1]["reason"]
    assert tools.ask(path, tools.NAVIGATION)[1]["epsilon"] == "1/1000"
    assert not any("1/1000" in json.dumps(line) for line in box)  # epsilon is an input of the check
    path.write_bytes(gzip.compress(b'{"format":"robust/certificate/1","kind":"plan"}\n["end"]\n'))
    code, answer = tools.ask(path, tools.NAVIGATION)
    assert code == 1
    assert answer["reason"].startswith("found a certificate of format robust/certificate/1, expected robust/cert")


def test_it_is_a_process_with_limits(box, tmp_path):
    def outcome(content):
        path = tmp_path / "cert"
        path.write_bytes(content)
        return verify(path, tools.NAVIGATION, epsilon=tools.EPSILON, kind="box")

    write(box, tmp_path / "box.cert")
    verification = outcome((tmp_path / "box.cert").read_bytes())
    assert verification.outcome is CheckerOutcome.ESTABLISHED
    assert verification.answer["files"].keys() == {"domain", "problem", "plan"}
    heavy = gzip.compress(b'["robust/certificate/2","plan",null]\n[' + b"[" * (80 << 20) + b"\n", 1)
    assert outcome(heavy).outcome is CheckerOutcome.REJECTED
    assert outcome(b"no gzip").outcome is CheckerOutcome.UNREADABLE


# -- forgeries ---------------------------------------------------------------------------------------------------------


def rejected(lines, ground):
    return isinstance(tools.judged(lines, ground), str)


def place_of(lines, kind):
    return next(index for index, line in enumerate(lines) if line[0] == kind)


def schedules_given_twice(lines):
    """Once it made everything outside contradictory: there is no line to put it."""
    at = place_of(lines, "schedule")
    for again in ([lines[at]], lines[at : at + 2]):
        yield from ([*lines[:at], *again, *lines[at:]], [*lines, *again])


def empty_covers(region):
    good = region[place_of(region, "good") :]
    for empty in (
        good,
        [["bad", []], ["cycle", [], []], *good],
        [["good"], ["orders"], ["rest"], ["refute", [[], [0]]]],
        [["bad", [[[["", "1"]], False]]], ["cycle", [0], []], ["good"]],
    ):
        yield [region[0], *empty]


def roots_smuggled_in(box):
    """A refutation starts from the checker's own literals: no line adds another."""
    at = place_of(box, "refute")
    for step in ([[], []], [[-1], []], [[2], [0]], [["t", 1], ["t", 2]], ["root", 3], [[3]], [[3], [3], [0], [0]]):
        for where in (1, len(box[at])):
            yield tools.put(box, at, [*box[at][:where], step, *box[at][where:]])


def names_of_nothing(region):
    """Sums with other names, a name twice, or a coefficient of zero."""
    for more in (["z", "1"], ["to_ridge", "1"], ["to_crater", "0"], ["@1", "1"], ["", "0"], [1, "1"]):
        for index, line in enumerate(region):
            if line[0] in ("bad", "piece", "schedule", "broken") and added(line, more) != line:
                yield tools.put(region, index, added(line, more))


def added(value, more):
    """The line with a term more in its first sum."""
    if not isinstance(value, list):
        return value
    if value and all(isinstance(term, list) and len(term) == 2 and isinstance(term[0], str) for term in value):
        return [*value, more]
    changes = (tools.put(value, index, added(inner, more)) for index, inner in enumerate(value))
    return next((change for change in changes if change != value), value)


def formulas_of_its_own(box):
    """Lines that name formulas, facts, points, labels or an epsilon, as certificates once did."""
    at = place_of(box, "refute")
    for line in (
        ["folded", "goal: (at scout base)"], ["obligation", "goal 1"], ["root", 1, "t"], ["epsilon", "-1"],
        ["constraint", 0, 1, [["1"]]], ["a", [[1, "x"]], True], {"format": "robust/certificate/2", "epsilon": "-1"},
        "refute", None, [],
    ):  # fmt: skip
        yield from (tools.put(box, at, line, box[at]), tools.put(box, at, line), [*box, line])


def everything_folded(lines):
    """Without refutations a refuted plan has no certificate, and a valid one neither."""
    yield [line for line in lines if line[0] != "refute"]
    yield [["refute", [[], []]] if line[0] == "refute" else line for line in lines]


def numbers_changed(box):
    """A wider box does not follow, and each number is written in one way."""
    for old, new in (("36", "37"), ("25", "24"), ("46", "1000"), ("35", "0")):
        yield [replaced_text(box[0], old, new), *box[1:]]
    for new in ("50/2", "+25", "025", " 25", "2_5", "25.0", "٢٥"):
        yield replaced_text(box, "25", new)


def replaced_text(value, old, new):
    if isinstance(value, list):
        return [replaced_text(inner, old, new) for inner in value]
    return new if value == old else value


@pytest.mark.parametrize(
    ("forgeries", "kind"),
    [
        (schedules_given_twice, "box"),
        (schedules_given_twice, "region"),
        (empty_covers, "region"),
        (roots_smuggled_in, "box"),
        (names_of_nothing, "region"),
        (formulas_of_its_own, "box"),
        (everything_folded, "box"),
        (everything_folded, "plan"),
        (numbers_changed, "box"),
    ],
)
def test_what_was_accepted_once_is_rejected(forgeries, kind, box, region, ground):
    lines = {"box": box, "region": region, "plan": tools.made(tools.NAVIGATION, "plan")}[kind]
    assert not rejected(lines, ground)
    for forged in forgeries(lines):
        assert forged != lines
        assert rejected(forged, ground), forged


@pytest.mark.parametrize(
    ("kind", "every"),
    [("box", 7), ("region", 23), *(pytest.param(kind, 1, marks=pytest.mark.slow) for kind in ("box", "region"))],
)
def test_true_is_not_one(kind, every, ground, request):
    """Each integer as a truth value, each truth value as an integer, and other twins."""
    lines = request.getfixturevalue(kind)
    twinned = [(path, twin) for path, value in leaves(lines)[::every] for twin in twins(value)]
    assert len(twinned) > 50
    for path, twin in twinned:
        assert rejected(replaced(lines, path, twin), ground), (path, twin)


def twins(value):
    """What equals a value, or looks like it, and is of another type."""
    if isinstance(value, bool):
        return int(value), str(value).lower()
    if value in (0, 1):
        return bool(value), float(value), str(value)
    return (str(value),) if isinstance(value, int) else ()


def leaves(value, path=()):
    if not isinstance(value, list):
        return [(path, value)]
    return [leaf for index, inner in enumerate(value) for leaf in leaves(inner, (*path, index))]


def replaced(value, path, new):
    return tools.put(value, path[0], replaced(value[path[0]], path[1:], new)) if path else new


def test_boxes_that_hold_nothing(box, ground):
    """What is true of nothing is not a claim."""
    (name, kind, (_, other)), *rest = box
    for ends, reason in (
        (["36", True, "25", True], "the box is empty"),
        (["25", False, "25", True], "the box is empty"),
        (["25", True, "25", False], "the box is empty"),
        ([None, True, "36", True], "an infinite end is closed"),
    ):
        assert tools.judged([[name, kind, [ends, other]], *rest], ground) == reason


def test_a_box_within_another_is_not_maximal(box, ground):
    """Its faces are shown to be bad where the faces of the other one are, or where its own end would be good."""
    widest = envelope(load_plan(*tools.NAVIGATION)).box
    faces = box[place_of(box, "face") :]
    for at, (name, interval) in enumerate(widest.intervals.items()):
        for smaller in (
            Interval(interval.lower + 1, interval.upper),
            Interval(interval.lower, interval.upper - 1),
            Interval(interval.lower, interval.upper, upper_closed=False),
        ):
            honest = tools.made(tools.NAVIGATION, "box", box=widest.replace(name, smaller))
            assert not rejected(honest, ground)
            for end in (None, str((smaller.lower + smaller.upper) / 2)):
                moved = [
                    ["face", *(tools.put(point, at, end or point[at]) for point in line[1:])]
                    if line[0] == "face" and line[1][at] == line[2][at]  # a face of the other parameter
                    else line
                    for line in faces
                ]
                assert rejected([[honest[0][0], "maximal", honest[0][2]], *honest[1:], *moved], ground)
