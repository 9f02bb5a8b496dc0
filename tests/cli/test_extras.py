"""What comes with extras: the core does without, and what needs one says which before anything is computed."""

import subprocess
import sys
from importlib.resources import files

import pytest

import robust
from robust.errors import UnsupportedError
from tests.cli.running import Ended, assert_one_line, environment, example

EXTRAS = ("matplotlib", "numpy", "networkx", "dd", "scipy", "dask", "unified_planning")
ROVER = example()
STEPS = example("steps.plan")
KITCHEN = str(files("robust.examples") / "kitchen" / "kitchen.tpnu.json")


def without_extras(*words: str) -> Ended:
    """A command in a process that finds none of the packages."""
    script = (
        f"import sys; sys.modules.update(dict.fromkeys({EXTRAS!r})); "
        f"from robust.cli import run; sys.exit(run({list(words)!r}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], check=False, capture_output=True, text=True, env=environment()
    )
    return Ended(done.returncode, done.stdout, done.stderr)


@pytest.mark.parametrize(
    "words",
    [
        ("check", *ROVER),
        ("envelope", *ROVER),
        ("region", *ROVER, "--latex"),
        (
            "risk",
            *ROVER,
            "--distribution",
            "to_ridge=normal:30:5",
            "--distribution",
            "to_crater=constant:40",
            "--within",
            "0.5",
        ),
        ("validate", *STEPS),
        ("convert", *STEPS, "--parameter", "duration:drive"),
        ("pike", "check", KITCHEN),
        ("pike", "compile", KITCHEN),
        ("pike", "run", KITCHEN, "--explain", "--outcome", "xA1=mug"),
    ],
    ids=lambda words: " ".join(words[:2]) if words[0] == "pike" else words[0],
)
def test_the_core_needs_no_extra(words):
    assert without_extras(*words, "--quiet").code == 0


@pytest.mark.parametrize(
    ("words", "package", "extra"),
    [
        (("envelope", *ROVER, "--plot", "box.svg"), "matplotlib", "plots"),
        (("pike", "plot", KITCHEN, "-o", "plan.svg"), "matplotlib", "plots"),
        (("pike", "compile", KITCHEN, "--backend", "bdd"), "dd", "bdd"),
        (("pike", "check", KITCHEN, "--cross"), "dd", "bdd"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_what_needs_an_extra_says_which(words, package, extra):
    ended = without_extras(*words)
    assert_one_line(ended, 4)
    assert f"found no {package}" in ended.err
    assert f"pip install 'robust-plans[{extra}]'" in ended.err


def test_python_says_which_extra_draws(monkeypatch):
    plan = robust.load_plan(*ROVER)
    found = robust.envelope(plan)
    for name in [name for name in sys.modules if name.startswith(("matplotlib", "robust.show."))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(UnsupportedError, match=r"found no matplotlib.*robust-plans\[plots\]"):
        found.plot()
