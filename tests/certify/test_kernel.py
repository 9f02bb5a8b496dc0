"""The checker that Coq proves right, where it is built: it says the same of certificates as the one in Python."""

import json
import subprocess
from fractions import Fraction
from pathlib import Path

import pytest

from robust.certify.checker.proofs import Tape
from robust.certify.kernel.claims import Translation
from robust.smt.limits import NEVER
from tests.certify import tools

KERNEL = Path(__file__).parents[2] / "proofs" / "kernel" / "robust-kernel"
pytestmark = pytest.mark.skipif(not KERNEL.exists(), reason="make -C proofs/kernel has not built it")
ALL = ("plan", "box", "maximal", "shape", "region")


def kernel(path, *words):
    return subprocess.run([KERNEL, *words, path], capture_output=True, text=True, check=False)


def said(ground, lines, path):
    """What the kernel says of a certificate."""

    def ask(text):
        path.write_text(text)
        return kernel(path, "--formulas").stdout

    tape = Tape(map(json.dumps, lines[1:]))
    path.write_text(Translation(ground, Fraction(1, 1000), NEVER).file(tape, *lines[0][1:], ["a plan"], ask))
    return kernel(path)


@pytest.mark.parametrize("kind", ALL)
def test_generator(kind, tmp_path):
    lines, ground = tools.made(tools.GENERATOR, kind), tools.grounded(tools.GENERATOR)
    answer = said(ground, lines, tmp_path / "generator.kernel")
    assert answer.returncode == 0, answer
    claim = tools.judged(lines, ground)
    assert claim.kind == kind
    assert answer.stdout.startswith("established: ")
    assert f"checked: {claim.obligations} obligations" in answer.stdout
    if kind in ("plan", "box", "maximal"):
        assert answer.stdout.startswith(f"established: {claim.text}, epsilon = 1/1000\n")
