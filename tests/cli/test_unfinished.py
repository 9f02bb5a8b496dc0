"""What is printed when time is out: nothing that the full answer contradicts, and each file is written or named."""

import re
from fractions import Fraction
from pathlib import Path

import pytest

import robust
from tests.cli.running import EXAMPLES, command, example

KITCHEN, SUITE = EXAMPLES / "kitchen" / "kitchen.tpnu.json", EXAMPLES / "two_sample_navigation"
RANDOM = ("--distribution", "to_ridge=normal:30:5", "--distribution", "to_crater=normal:40:5")
COFFEE = ("--parameter", "coffee=duration:make-coffee", "--parameter", "limit=at-most:e1:e44")
COMMANDS = {
    "check": ("check", *example()),
    "region": ("region", *example(), "--plot", "FILE.svg"),
    "latex": ("region", *example(), "--latex"),
    "compare": ("compare", *example(), "--plot", "FILE.svg", "--html", "FILE.html"),
    "widen": ("envelope", *example(), "--plot", "FILE.svg", "--export", "csv", "-o", "FILE.csv"),
    "irr": ("envelope", *example(), "--method", "irr", "--export", "plansys2", "-o", "FILE.yaml"),
    "optimal": ("envelope", *example(), "--method", "optimal"),
    "most probable": ("envelope", *example(), "--method", "risk", *RANDOM),
    "controllable": ("envelope", *example(), "--controllability", "dynamic"),
    "risk": ("risk", *example(), *RANDOM, "--plot", "FILE.svg"),
    "repair": ("repair", *example(), "--change", "both", "-o", "FILE.stn"),
    "certify": ("certify", *example(), "-o", "FILE.cert"),
    "batch": ("batch", "envelope", SUITE, "--csv", "FILE.csv", "--html", "FILE.html"),
    "batch compare": ("batch", "compare", SUITE),
    "pike check": ("pike", "check", KITCHEN, "--all-scenarios"),
    "pike compile": ("pike", "compile", KITCHEN),
    "pike chance": ("pike", "chance", KITCHEN),
    "pike region": ("pike", "region", KITCHEN, *COFFEE, "--plot", "FILE.svg"),
    "pike envelope": ("pike", "envelope", KITCHEN, *COFFEE, "--plot", "FILE.svg"),
    "stnu repair": ("stnu", "repair", EXAMPLES / "handover" / "handover.stnu"),
}
LINES = Path(__file__).with_name("unfinished.txt").read_text(encoding="utf-8").splitlines()
SENTENCES = [re.compile(line) for line in LINES if not line.startswith("#")]
"""What a line of an answer without end can say; what is said of a box or a probability, an oracle judges."""


@pytest.fixture(scope="module")
def full():
    """The region and the probability of success; and what draws is loaded, which a limit would leave half imported."""
    whole = robust.region(example())
    whole.plot()
    return whole.region, robust.risk(example(), RANDOM[1::2]).probability


@pytest.mark.parametrize(
    "seconds",
    [
        "1e-9",
        *(pytest.param(f"{time}", marks=pytest.mark.slow) for time in (0.001, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8)),
    ],
)
@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_asserted_that_is_not_known(tmp_path, full, name, seconds):
    words = [word.replace("FILE", str(tmp_path / name)) if isinstance(word, str) else word for word in COMMANDS[name]]
    files = [word for word, pattern in zip(words, COMMANDS[name], strict=True) if word != pattern]
    ended = command(*words, "--timeout", seconds)
    assert "internal error" not in ended.err
    unwritten = re.findall(r"robust: (\S.*) was not written: the answer has nothing for it\n", ended.err)
    assert sorted(unwritten) == sorted(file for file in files if not (tmp_path / file).exists())
    assert ended.code == 3 or (ended.code == 0 and seconds != "1e-9")
    for line in ended.out.splitlines() if ended.code == 3 else ():
        matches = [match for sentence in SENTENCES if (match := sentence.fullmatch(line.rstrip()))]
        assert matches or not line, line
        said = matches[0].groupdict() if matches else {}
        if "box" in said:
            ends = re.findall(r"(\w+) ∈ [\[(](\S+), (\S+)[\])]", said["box"])
            assert ends
            assert {name: (Fraction(lower) + Fraction(upper)) / 2 for name, lower, upper in ends} in full[0]
        elif "lower" in said:
            assert Fraction(said["lower"]) <= full[1].upper
            assert Fraction(said["upper"]) >= full[1].lower
    _, _, ends = ended.out.partition("What ends each side:\n")
    for line in ends.partition("\n\n")[0].splitlines() if ended.code == 3 else ():
        assert line.endswith((": not reached: the search was cut short", ": not examined", ": declared bound"))
