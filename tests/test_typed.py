"""The package is typed: mypy, strictly, reads a script that uses all of it, and finds what is wrong in another."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import robust
from robust import pike, stnu

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = Path(__file__).with_name("typed_script.py")


def read_by_mypy(script: Path) -> str:
    """What mypy says with the options of the project, which are strict; what it knows of the package is kept."""
    pytest.importorskip("mypy")
    words = [sys.executable, "-m", "mypy", str(script)]
    environment = {**os.environ, "MYPYPATH": str(ROOT)}
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=ROOT, env=environment)
    assert not done.stderr, done.stderr
    return done.stdout


def test_scripts_of_users_are_checked(tmp_path):
    assert read_by_mypy(SCRIPT).startswith("Success"), SCRIPT
    wrong = tmp_path / "wrong.py"
    text = 'import robust\n\nplan = robust.load_plan("d", "p", "s")\nrobust.check(plan, encodin="positions")\n'
    text += 'robust.envelope(plan, beta=[1]).box.area\nrobust.risk(plan, {"a": "normal:3:1"}, withing=1)\n'
    wrong.write_text(text + 'robust.batch("compare", "suite", job=2, regio="project")\n', encoding="utf-8")
    found = read_by_mypy(wrong)
    for name in ("encodin", "withing", "job", "regio"):
        assert f'Unexpected keyword argument "{name}"' in found
    assert 'Argument "beta"' in found
    assert 'has no attribute "area"' in found


def test_the_script_uses_every_public_name():
    text = SCRIPT.read_text(encoding="utf-8")
    functions = [name for name in robust.__all__ if name.islower() and callable(getattr(robust, name))]
    elsewhere = {"from_unified_planning", "to_unified_planning"}  # what they take is not typed
    assert not [name for name in functions if f"robust.{name}(" not in text and name not in elsewhere]
    for module, asked in ((pike, ("check", "compile", "run", "region", "envelope")), (stnu, ("check", "repair"))):
        assert not [name for name in asked if f"{module.__name__.split('.')[1]}.{name}(" not in text]


@pytest.mark.parametrize("module", [robust, pike, stnu], ids=lambda module: module.__name__)
def test_public_names_exist_and_are_documented(module):
    for name in module.__all__:
        found = getattr(module, name)
        if isinstance(found, type) or callable(found):
            assert (found.__doc__ or "").strip(), name
            assert not (found.__doc__ or "").startswith(f"{name}("), f"{name} has no words of its own"
