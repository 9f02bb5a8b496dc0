"""What is there before anything is computed: help, version, what is loaded."""

import subprocess
import sys

import pytest

import robust
from tests.cli.running import command, environment, process

HEAVY = ("pysmt", "z3", "cvc5", "sympy", "matplotlib", "joblib", "rich")

HELP = """\
Usage: robust [OPTIONS] COMMAND [ARGS]...

  Verify temporal plans: are they valid for every schedule, and how far may
  reality deviate?

Options:
  --version             Show the version and exit.
  --install-completion  Install completion for the current shell.
  --show-completion     Show completion for the current shell, to copy it or
                        customize the installation.
  -h, --help            Show this message and exit.

Commands:
  check     Is a plan valid for every schedule it allows?
  envelope  How far may parameters deviate?
  region    All parameter values for which a plan is valid.
  compare   The exact region beside the boxes of all methods.
  convert   Make a flexible plan of a planner's output.
  execute   Execute in simulated worlds, and plan anew when needed.
  certify   Write down why a plan is valid, for a checker without solver.
  verify    Check a certificate, in a process of its own.
  demo      Take a tour on shipped examples.
  pike      Plans with choices: which still lead to a correct execution?
  bench     Measure: recorded data sets, the figures of the paper,...

  Exit codes: 0 proved or done, 1 refuted, 2 bad input, 3 unknown, out of time
  or interrupted, 4 unsupported.
"""

OPTIONS = {
    ("check",): "--at --all --parameter --parameters --epsilon --encoding --solver --timeout --smt2 "
    "--json --quiet --verbose",
    ("envelope",): "--method --beta --doubling --contain-nominal --encoding --order --controllability "
    "--parameter --parameters --epsilon --solver --timeout --plot --smt2 --json --quiet --verbose",
    ("region",): "--backend --splitting --learning --no-learning --form --latex --parameter --parameters --epsilon "
    "--encoding --solver --timeout --plot --axes --json --quiet --verbose",
    ("compare",): "--beta --parameter --parameters --epsilon --encoding --solver --timeout --plot --axes --html "
    "--json --quiet --verbose",
    ("certify",): "--output --kind --box --alethe --parameter --parameters --epsilon --encoding --solver --timeout "
    "--json --quiet --verbose",
    ("verify",): "--parameter --parameters --timeout --json",
    ("demo",): "",
    ("convert",): "--output --mode --parametrize --epsilon --solver --timeout --json --quiet --verbose",
    ("execute",): "--executor --planner --world --seed --runs --parametrize --parameters --method --controllability "
    "--replans --planner-limit --planning-time --stop-running --epsilon --solver --timeout --plot --json --quiet "
    "--verbose",
    ("pike", "run"): "--human --pace --outcome --disturb --delay --seed --backend --stdio --journal --clock --rate "
    "--infer --no-infer --explain --plot --epsilon --solver --timeout --json --quiet --verbose",
    ("bench", "recorded"): "--suite --jobs --limit --plot --json --quiet --verbose",
    ("bench", "scaling"): "--jobs --limit --plot --json --quiet --verbose",
    **{
        ("bench", figure): "--problems --seed --largest --backend --jobs --cluster --store --limit --plot --json "
        "--quiet --verbose"
        for figure in ("figure17", "figure18")
    },
}


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["check", "--help"], ["bench", "scaling", "--help"]])
def test_nothing_heavy_is_imported(arguments):
    script = (
        "import sys; from robust.cli import run; "
        f"code = run({arguments!r}); "
        f"print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr); sys.exit(code)"
    )
    words = [sys.executable, "-W", "error", "-c", script]
    done = subprocess.run(words, check=False, capture_output=True, text=True, env=environment())
    assert (done.returncode, done.stderr) == (0, "[]\n")


def test_help_loads_little():
    """What takes time at the start is loading modules; seconds would depend on what else the machine does."""
    script = (
        "import sys; before = set(sys.modules); from robust.cli import run; run(['--help']); "
        "print(*sorted(set(sys.modules) - before), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True, env=environment())
    loaded = done.stderr.split()
    assert "robust.cli" in loaded
    assert len([name for name in loaded if name.startswith("robust")]) < 30
    assert len(loaded) < 250


def test_help():
    assert process("--help").out == HELP
    assert process("-h").out == HELP


def test_without_a_command():
    ended = process()
    assert (ended.code, ended.out, ended.err) == (2, "", HELP)
    ended = command("bench")
    assert ended.code == 2
    assert ended.err.startswith("Usage: robust bench ")


@pytest.mark.parametrize("words", OPTIONS, ids=" ".join)
def test_options(words):
    ended = process(*words, "--help")
    assert (ended.code, ended.err) == (0, "")
    listed = [word for line in ended.out.splitlines() for word in line.split() if line.startswith("  -")]
    found = [word for word in dict.fromkeys(listed) if word.startswith("--") and word != "--help"]
    assert found == OPTIONS[words].split()
    assert all(len(line) <= 80 for line in ended.out.splitlines())


def test_version():
    ended = command("--version")
    assert (ended.code, ended.out, ended.err) == (0, f"robust {robust.__version__}\n", "")
