"""What comes with extras: the core does without, and what needs one says which before anything is computed."""

import json
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


def without_extras(*lines: tuple[str, ...]) -> list[Ended]:
    """Commands, one after the other, in a process that finds none of the packages."""
    script = f"""
import json, sys
sys.modules.update(dict.fromkeys({EXTRAS!r}))
from tests.cli.running import command
print(json.dumps([[(ended := command(*words)).code, ended.out, ended.err] for words in {lines!r}]))
"""
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True, env=environment())
    return [Ended(*each) for each in json.loads(done.stdout)]


CORE = (
    ("check", *ROVER),
    ("envelope", *ROVER),
    ("region", *ROVER, "--latex"),
    ("risk", *ROVER, *(f"--distribution={each}" for each in ("to_ridge=normal:30:5", "to_crater=constant:40")),
     "--within", "0.5"),
    ("validate", *STEPS),
    ("convert", *STEPS, "--parameter", "duration:drive"),
    ("pike", "check", KITCHEN),
    ("pike", "compile", KITCHEN),
    ("pike", "run", KITCHEN, "--explain", "--outcome", "xA1=mug"),
)  # fmt: skip
NEEDED = (
    (("envelope", *ROVER, "--plot", "box.svg"), "matplotlib", "plots"),
    (("pike", "plot", KITCHEN, "-o", "plan.svg"), "matplotlib", "plots"),
    (("pike", "compile", KITCHEN, "--backend", "bdd"), "dd", "bdd"),
    (("pike", "check", KITCHEN, "--cross"), "dd", "bdd"),
)


def test_the_core_needs_no_extra():
    ended = without_extras(*((*words, "--quiet") for words in CORE))
    assert [each.code for each in ended] == [0] * len(CORE), ended


def test_what_needs_an_extra_says_which():
    for ended, (_, package, extra) in zip(without_extras(*(words for words, *_ in NEEDED)), NEEDED, strict=True):
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
