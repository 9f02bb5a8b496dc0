"""The checker: what it says, what it demands, and forgeries of every class that once was accepted."""

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
    found = {line for word in words if word.type not in silent for line in range(word.start[0], word.end[0] + 1)}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            found -= {*range(node.lineno, (node.end_lineno or node.lineno) + 1)}
    return found


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    """A maximal box and its certificate."""
    path = tmp_path_factory.mktemp("box") / "box.cert"
    lines = tools.made(tools.NAVIGATION, "maximal")
    write(lines, path)
    return path, lines


def test_it_runs_from_a_copy_of_its_folder(box, tmp_path):
    """With any hash seed; nothing of this package is on its path."""
    copied = tmp_path / "checker"
    shutil.copytree(FOLDER, copied, ignore=shutil.ignore_patterns("__pycache__"))
    answers = set()
    for seed in ("0", "1", "7"):
        words = [sys.executable, "-m", "checker", str(box[0]), *map(str, tools.NAVIGATION)]
        variables = {**os.environ, "PYTHONPATH": "", "PYTHONHASHSEED": seed}
        ended = subprocess.run(words, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False)
        assert (ended.returncode, ended.stderr) == (0, "")
        answers.add(ended.stdout)
    (said,) = answers
    assert said.startswith(
        "established: valid for every schedule, for all (to_ridge, to_crater) in [25, 36] x [35, 46]; no other valid "
        "box within the declared bounds contains this one, epsilon = 1/1000\nof domain: sha256 "
    )


CHANGES = [
    ("(at 21 (lit ridge))", "(at 31 (lit ridge))"),
    ("parameter to_ridge", "parameter to_valley"),
    ("(:goal", "(:goal (and) (:goal"),
]


def test_files_of_another_content_are_not_what_was_certified(box, tmp_path):
    """The checker reads the files themselves: any change that matters is another plan."""
    for place, (old, new) in enumerate(CHANGES):
        files = [tmp_path / f"{place}-{path.name}" for path in tools.NAVIGATION]
        texts = [path.read_text(encoding="utf-8") for path in tools.NAVIGATION]
        changed = [text.replace(old, new) for text in texts]
        assert changed != texts
        for path, text in zip(files, changed, strict=True):
            path.write_text(text, encoding="utf-8")
        assert tools.ask(box[0], files)[0] in (1, 4), old
    swapped = [tools.NAVIGATION[1], tools.NAVIGATION[0], tools.NAVIGATION[2]]
    assert tools.ask(box[0], swapped)[0] == 4
    assert tools.ask(box[0], [*tools.NAVIGATION[:2], tmp_path / "missing"])[0] == 2


def test_claims_that_are_demanded(box, tmp_path):
    path, lines = box
    for kind in ("plan", "box", "maximal"):
        assert tools.ask(path, tools.NAVIGATION, kind=kind)[0] == 0
    assert "expected region" in tools.ask(path, tools.NAVIGATION, kind="region")[1]["reason"]
    weaker = tmp_path / "plan.cert"
    assert tools.command(tools.made(tools.NAVIGATION, "plan"), weaker, tools.NAVIGATION)[0] == 0
    for kind in ("box", "maximal", "region", "knowledge"):
        assert f"expected {kind}" in tools.ask(weaker, tools.NAVIGATION, kind=kind)[1]["reason"]
    ends = {"to_ridge": {"lower": "25", "upper": "36"}, "to_crater": {"lower": "35", "upper": "46"}}
    wanted = tmp_path / "wanted.json"

    def demand(kind=None, **changes):
        document = {name: {**each, **changes.get(name, {})} for name, each in ends.items()}
        wanted.write_text(json.dumps({"parameters": document}), encoding="utf-8")
        return tools.ask(path, tools.NAVIGATION, box=str(wanted), kind=kind)[0]

    assert demand() == demand(kind="maximal") == 0
    smaller = {"to_ridge": {"lower": "26"}}
    assert (demand(**smaller), demand("box", **smaller), demand("maximal", **smaller)) == (0, 0, 1)
    for changed in ({"lower": "24"}, {"upper": "36.1"}, {"upper": "inf"}):
        assert demand(to_ridge=changed) == 1
    assert lines[0][1] == "maximal"


def test_a_claim_is_about_the_epsilon_that_is_asked_for(box):
    """It is an input of the check: the certificate names none."""
    assert tools.ask(box[0], tools.NAVIGATION, epsilon="1/1000")[1]["epsilon"] == "1/1000"
    assert tools.ask(box[0], tools.NAVIGATION, epsilon="100")[0] == 1
    for wrong in ("-1", "x", "1/0", ""):
        assert tools.ask(box[0], tools.NAVIGATION, epsilon=wrong)[0] in (1, 4)
    assert not any("1/1000" in json.dumps(line) for line in box[1])


def test_old_certificates_are_refused(tmp_path):
    path = tmp_path / "old.cert"
    path.write_bytes(gzip.compress(b'{"format":"robust/certificate/1","kind":"plan"}\n["end"]\n'))
    code, answer = tools.ask(path, tools.NAVIGATION)
    assert code == 1
    assert answer["reason"].startswith("found a certificate of format robust/certificate/1, expected robust/cert")


def test_it_is_a_process_with_limits(box, tmp_path):
    found = verify(box[0], tools.NAVIGATION, epsilon=tools.EPSILON, kind="box")
    assert found.outcome is CheckerOutcome.ESTABLISHED
    assert found.answer["files"].keys() == {"domain", "problem", "plan"}
    heavy = tmp_path / "heavy.cert"
    heavy.write_bytes(gzip.compress(b'["robust/certificate/2","plan",null]\n[' + b"[" * (80 << 20) + b"\n"))
    assert verify(heavy, tools.NAVIGATION, epsilon=tools.EPSILON).outcome is CheckerOutcome.REJECTED
    nothing = tmp_path / "nothing.cert"
    nothing.write_bytes(b"no gzip")
    assert verify(nothing, tools.NAVIGATION, epsilon=tools.EPSILON).outcome is CheckerOutcome.UNREADABLE


# -- forgeries ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ground():
    return tools.grounded(tools.NAVIGATION)


def place_of(lines, kind, start=0):
    return next(index for index, line in enumerate(lines) if index >= start and line[0] == kind)


def test_a_schedule_given_twice(box, ground):
    """Once it made everything outside contradictory: there is no line to put it."""
    region = tools.made(tools.NAVIGATION, "region")
    assert not isinstance(tools.judged(region, ground), str)
    for lines in (box[1], region):
        at = place_of(lines, "schedule")
        for again in ([lines[at]], lines[at : at + 2]):
            assert isinstance(tools.judged([*lines[:at], *again, *lines[at:]], ground), str)
            assert isinstance(tools.judged([*lines, *again], ground), str)
    assert isinstance(tools.judged([region[0], *region[place_of(region, "good") :]], ground), str)
    for empty in (
        [["bad", []], ["cycle", [], []], *region[place_of(region, "good") :]],
        [["good"], ["orders"], ["rest"], ["refute", [[], [0]]]],
        [["bad", [[[["", "1"]], False]]], ["cycle", [0], []], ["good"]],
    ):
        assert isinstance(tools.judged([region[0], *empty], ground), str)


def test_roots_cannot_be_smuggled_in(box, ground):
    """A refutation starts from the checker's own literals: no line adds another."""
    lines = box[1]
    at = place_of(lines, "refute")
    for step in ([[], []], [[-1], []], [[2], [0]], [["t", 1], ["t", 2]], ["root", 3], [[3]], [[3], [3], [0], [0]]):
        for where in (1, len(lines[at])):
            forged = [*lines[at][:where], step, *lines[at][where:]]
            assert isinstance(tools.judged([*lines[:at], forged, *lines[at + 1 :]], ground), str), step


@pytest.mark.parametrize(
    ("kind", "every"),
    [("box", 3), ("region", 7), *(pytest.param(kind, 1, marks=pytest.mark.slow) for kind in ("box", "region"))],
)
def test_true_is_not_one(kind, every, box, ground):
    """Each integer as a truth value, each truth value as an integer, and other twins."""
    lines = box[1] if kind == "box" else tools.made(tools.NAVIGATION, kind)
    places = [(index, path, value) for index, line in enumerate(lines) for path, value in leaves(line)]
    count = 0
    for index, path, value in places[::every]:
        for twin in twins(value):
            forged = [*lines[:index], replaced(lines[index], path, twin), *lines[index + 1 :]]
            assert isinstance(tools.judged(forged, ground), str), (index, path, twin)
            count += 1
    assert count > 50


def twins(value):
    """What equals a value, or looks like it, and is of another type."""
    if isinstance(value, bool):
        return int(value), str(value).lower()
    if value in (0, 1):
        return bool(value), float(value), str(value)
    return (str(value),) if isinstance(value, int) else ()


def leaves(value, path=()):
    if isinstance(value, list):
        for index, each in enumerate(value):
            yield from leaves(each, (*path, index))
    else:
        yield path, value


def replaced(value, path, new):
    if not path:
        return new
    return [replaced(each, path[1:], new) if index == path[0] else each for index, each in enumerate(value)]


def test_names_are_those_of_the_plan(ground):
    """Sums with other names, a name twice, or a coefficient of zero."""
    region = tools.made(tools.NAVIGATION, "region")
    for more in (["z", "1"], ["to_ridge", "1"], ["to_crater", "0"], ["@1", "1"], ["", "0"], [1, "1"]):
        for kind in ("bad", "piece", "schedule", "broken"):
            for index, line in enumerate(region):
                forged = added(line, more)
                if line[0] == kind and forged != line:
                    assert isinstance(tools.judged([*region[:index], forged, *region[index + 1 :]], ground), str)


def added(value, more):
    """The line with a term more in its first sum."""
    if isinstance(value, list):
        if value and all(isinstance(each, list) and len(each) == 2 and isinstance(each[0], str) for each in value):
            return [*value, more]
        for index, each in enumerate(value):
            new = added(each, more)
            if new != each:
                return [*value[:index], new, *value[index + 1 :]]
    return value


@pytest.mark.parametrize("change", [("36", "37"), ("25", "24"), ("46", "1000"), ("35", "0")])
def test_a_box_of_its_own(box, ground, change):
    """The claim is printed from what was checked; a wider one does not follow."""
    lines = [replaced_text(box[1][0], *change), *box[1][1:]]
    assert lines[0] != box[1][0]
    assert isinstance(tools.judged(lines, ground), str)


def replaced_text(value, old, new):
    if isinstance(value, list):
        return [replaced_text(each, old, new) for each in value]
    return new if value == old else value


def test_a_formula_of_its_own(box, ground):
    """Lines that name formulas, facts, points, labels or an epsilon, as certificates once did."""
    at = place_of(box[1], "refute")
    for line in (
        ["folded", "goal: (at scout base)"],
        ["obligation", "goal 1"],
        ["root", 1, "t"],
        ["epsilon", "-1"],
        ["constraint", 0, 1, [["1"]]],
        ["a", [[1, "x"]], True],
        {"format": "robust/certificate/2", "epsilon": "-1"},
        "refute",
        None,
        [],
    ):
        for forged in ([*box[1][:at], line, *box[1][at:]], [*box[1][:at], line, *box[1][at + 1 :]], [*box[1], line]):
            assert isinstance(tools.judged(forged, ground), str), line


def test_everything_folded(ground):
    """Without refutations a refuted plan has no certificate, and a valid one neither."""
    for lines in (tools.made(tools.NAVIGATION, kind) for kind in ("plan", "box")):
        kept = [line for line in lines if line[0] != "refute"]
        assert isinstance(tools.judged(kept, ground), str)
        empty = [["refute", [[], []]] if line[0] == "refute" else line for line in lines]
        assert isinstance(tools.judged(empty, ground), str)


def test_boxes_that_hold_nothing(box, ground):
    """What is true of nothing is not a claim."""
    for first in (["36", True, "25", True], ["25", False, "25", True], ["25", True, "25", False]):
        header = [*box[1][0][:2], [first, box[1][0][2][1]]]
        claim = tools.judged([header, *box[1][1:]], ground)
        assert claim == "the box is empty"
    outside = [*box[1][0][:2], [[None, True, "36", True], box[1][0][2][1]]]
    assert tools.judged([outside, *box[1][1:]], ground) == "an infinite end is closed"


@pytest.mark.parametrize("name", ["to_ridge", "to_crater"])
@pytest.mark.parametrize("way", ["lower", "upper", "open"])
def test_a_box_within_another_is_not_maximal(ground, name, way):
    """Its faces are shown to be bad where the faces of the other one are, or where its own end would be good."""
    widest = envelope(load_plan(*tools.NAVIGATION)).box
    each = widest[name]
    smaller = {
        "lower": Interval(each.lower + 1, each.upper),
        "upper": Interval(each.lower, each.upper - 1),
        "open": Interval(each.lower, each.upper, upper_closed=False),
    }[way]
    honest = tools.made(tools.NAVIGATION, "box", box=widest.replace(name, smaller))
    assert not isinstance(tools.judged(honest, ground), str)
    faces = tools.made(tools.NAVIGATION, "maximal")
    faces = faces[place_of(faces, "face") :]
    inner = str((smaller.lower + smaller.upper) / 2)
    for moved in (lambda limit, beyond: (limit, beyond), lambda limit, beyond: (inner, inner)):
        lines = [[honest[0][0], "maximal", honest[0][2]], *honest[1:]]
        at = list(widest.intervals).index(name)
        for line in faces:
            lines.append(line)
            if line[0] == "face" and line[1][at] == line[2][at]:  # a face of the other parameter
                ends = moved(line[1][at], line[2][at])
                lines[-1] = ["face", *(replaced(point, (at,), end) for point, end in zip(line[1:], ends, strict=True))]
        assert isinstance(tools.judged(lines, ground), str)


def test_numbers_are_canonical(box, ground):
    for old, new in (
        ("25", "50/2"),
        ("25", "+25"),
        ("25", "025"),
        ("25", " 25"),
        ("25", "2_5"),
        ("25", "25.0"),
        ("25", "٢٥"),
    ):
        lines = [replaced_text(line, old, new) for line in box[1]]
        assert isinstance(tools.judged(lines, ground), str), new


@pytest.mark.parametrize("seed", range(12))
def test_what_is_mutex_does_not_depend_on_the_seed_of_hashes(seed):
    """The order of obligations is the tape's order."""
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); from checker.reader import ground; "
        "from checker.formulas import Formulas; from fractions import Fraction; "
        "f = Formulas(ground(*sys.argv[2:]), Fraction(1, 1000)); "
        "print([(label, make()) for label, make in f.obligations()], f.circuit.nodes)"
    )
    texts = random_texts(seed)
    said = set()
    for number in ("1", "2"):
        words = [sys.executable, "-c", script, str(FOLDER.parent), *texts]
        variables = {**os.environ, "PYTHONHASHSEED": number}
        ended = subprocess.run(words, env=variables, capture_output=True, text=True, check=False)
        said.add(ended.stdout or ended.stderr.splitlines()[-1])
    assert len(said) == 1
