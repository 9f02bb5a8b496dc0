"""What is printed when time is out: nothing that the full answer contradicts, and each file is written or named."""

import re
from fractions import Fraction

import pytest

import robust
from robust.qe.box import Box, Interval
from tests.cli.running import EXAMPLES, command, example

KITCHEN = EXAMPLES / "kitchen" / "kitchen.tpnu.json"
STNU = EXAMPLES / "handover" / "handover.stnu"
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
    "batch": ("batch", "envelope", str(EXAMPLES / "two_sample_navigation"), "--csv", "FILE.csv", "--html", "FILE.html"),
    "batch compare": ("batch", "compare", str(EXAMPLES / "two_sample_navigation")),
    "pike check": ("pike", "check", str(KITCHEN), "--all-scenarios"),
    "pike compile": ("pike", "compile", str(KITCHEN)),
    "pike region": ("pike", "region", str(KITCHEN), *COFFEE, "--plot", "FILE.svg"),
    "pike envelope": ("pike", "envelope", str(KITCHEN), *COFFEE, "--plot", "FILE.svg"),
    "stnu repair": ("stnu", "repair", str(STNU)),
}


SENTENCES = {
    # of all
    r"": None,
    r"(robust: )?out of time": None,
    r" +.*": None,  # tables and lists, of which `judged` looks at the inequalities
    r"(optimal around the nominal values|optimal|widening|IRR): no box is known": None,
    # check, region
    r"unknown: out of time": None,
    r"\d+ of \d+ obligations? proved.*": None,
    r"No parameter values are known by now for which the plan can fail\.": None,
    r"The plan can be valid only if( all lines of one of these \d+ groups hold)?": "outer",
    r"and not all lines of (this group|one of these groups) hold": None,
    r"The plan is certain to be valid if all lines of one of these groups hold": None,
    r"out of time: an outer bound of the envelope; outside the plan can fail, inside it may": None,
    r"proved valid: \d+ polyhedr(on|a)(; open: .*)?": None,
    r"\d+ polyhedr(on|a) of bad values, project, .*": None,
    r"% out of time: an outer bound of the robustness envelope: the time limit ended .*": None,
    r"\\top|\\mathit.*|\\left.*|\\lnot.*|\\begin.*|\\end.*|\\bot": None,
    # boxes
    r"(optimal around the nominal values|optimal|widening|IRR): (?P<box>.* ∈ .*)": "box",
    r"out of time: gaps are at most those shown, shares at least(; region [^;]*)?": None,
    r"out of time; the nominal values are not decided, no box is known": None,
    r"out of time.*: the box is proved.*": None,
    # chance, repair
    r"probability of success: (?P<lower>[0-9.]+) to (?P<upper>[0-9.]+)": "probability",
    r"What boxes keep:": None,
    r"What ends each side:": None,
    r"out of time: the best box so far; sound, not maximal": None,
    r"\d+ checks?, .*": None,
    r"probability of the box: [0-9.]+(; how probable others may be is not known|; no box has more than [0-9.]+)": None,
    r"What fails, each value counted for the first that breaks:": None,
    r"out of time: certified bounds so far, .*": None,
    r"unknown: out of time, no repair found; none costs less than cost 0": None,
    r"\d+ plans? examined; .*": None,
    # many plans
    r"\d+ of 3 plans: .*": None,
    r"(IRR|CCMMZ) answers 0 of 3 in .*": None,
    r"incomplete: \d+ of \d+ tasks done; with --store FILE an interrupted run can be resumed": None,
    # plans with choices, networks
    r"Undecided: out of time\.": None,
    r"\d+ team scenarios so far:.*": None,
    r"Not compiled: out of time in stage '.*'\.": None,
    r"No parameter values are known yet to lead to a correct execution\.": None,
    r"Nothing is known yet.*": None,
    r"For some choice of values: no correct execution is known yet at the nominal values\.": None,
    r"With .*, or": None,
    r"With .*, as far as is known yet: .*": None,
    r"(coffee|limit): .*": None,
    r"out of time: \d+ (polyhedr|box).*": None,
    r"unknown: no repair found; none costs less than 0": None,
}
"""What an answer without end can say, line by line, and which oracle judges it; nothing else is said."""


@pytest.fixture(scope="module")
def full():
    """The full answers about the plan: its region, and the probability."""
    plan = robust.load_plan(*example())
    random = dict(text.split("=") for text in RANDOM[1::2])
    return robust.region(plan).region, robust.risk(plan, random).probability


def judge(line, full):
    """A line is one that is known, and the full answer does not contradict it."""
    region, probability = full
    found = [(oracle, each) for text, oracle in SENTENCES.items() if (each := re.fullmatch(text, line.rstrip()))]
    assert found, line
    oracle, said = found[0]
    if oracle == "box":
        ends = [
            re.fullmatch(r"(\w+) ∈ [\[(](\S+), (\S+)[\])]", one).groups()
            for one in re.split(r", (?=\w+ ∈)", said["box"])
        ]
        box = Box({name: Interval(Fraction(lower), Fraction(upper)) for name, lower, upper in ends})
        assert all(point in region for point in [{n: (i.lower + i.upper) / 2 for n, i in box.intervals.items()}])
    elif oracle == "probability":
        assert Fraction(said["lower"]) <= probability.upper
        assert Fraction(said["upper"]) >= probability.lower


def run_out_of_time(name, seconds, tmp_path, full):
    files = {
        word: tmp_path / f"{name}{word.removeprefix('FILE')}" for word in COMMANDS[name] if word.startswith("FILE")
    }
    ended = command(*(files.get(word, word) for word in COMMANDS[name]), "--timeout", seconds)
    assert "internal error" not in ended.err
    unwritten = re.findall(r"robust: (\S.*) was not written: the answer has nothing for it\n", ended.err)
    assert sorted(unwritten) == sorted(str(one) for one in files.values() if not one.exists())
    if ended.code == 3:
        for line in ended.out.splitlines():
            judge(line, full)
        _, _, ends = ended.out.partition("What ends each side:\n")
        for line in ends.partition("\n\n")[0].splitlines():
            assert line.endswith((": not reached: the search was cut short", ": not examined", ": declared bound"))
    return ended.code


@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_asserted_that_is_not_known(tmp_path, full, name):
    assert run_out_of_time(name, "1e-9", tmp_path, full) == 3


@pytest.mark.slow
@pytest.mark.parametrize("seconds", ["0.001", "0.01", "0.02", "0.05", "0.1", "0.2", "0.4", "0.8"])
@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_asserted_that_is_not_known_at_any_time(tmp_path, full, name, seconds):
    assert run_out_of_time(name, seconds, tmp_path, full) in {0, 3}
