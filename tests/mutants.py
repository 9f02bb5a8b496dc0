"""How strong the quick tests are: small changes to the code, each of which some test should notice.

    python -m tests.mutants [PART ...] [--each N] [--seed S] [--only PATTERN]

For each part of the code below (all, unless some are named), draws N of the mutants that mutmut makes of it, runs for
each the tests of that part that call what was changed, and prints how many were noticed and the name of every one that
was not, with its change. Mutants that no test can or should notice are listed in `mutants_accepted.txt`: the function,
the line that the change makes, and why; they count neither way. Exit code 1 if fewer than 90 % were noticed. The
working copies are `mutants/PART/`; they are kept, so that a second run times only new tests and runs only the mutants
that were not noticed before or whose function has changed: delete them to measure from scratch.
"""

import argparse
import fnmatch
import json
import os
import random
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
ACCEPTED = Path(__file__).with_name("mutants_accepted.txt")
CHANGED = "robust"
COPIED = ("tests", "proofs", "benchmarks", "docs", "constraints.txt", "README.md")
KILLED = (1, 3)
"""Exit codes of pytest where a test failed, or could not even start."""
UNNOTICED = (0, 33)
"""33: no test calls it, as far as mutmut sees, which is neither child processes nor what ran at import."""
TIMEOUT = (24, 36, -24, 152, 255)
ENOUGH = 0.9
PATIENCE = 900
"""Seconds for all tests of a part."""


class Part(NamedTuple):
    """Code that is changed (files), and the quick tests that should notice it; those without must be left out."""

    code: tuple[str, ...]
    tests: tuple[str, ...]
    without: str = ""


def of(folder, *names):
    return tuple(f"{folder}/{name}" for name in names)


RECORDED = " or ".join(f"recorded[{group}" for group in ("check", "convert", "envelope", "region", "execute"))
PARTS = {
    "qe": Part(
        of("robust/qe", "box.py", "conjunctions.py", "constraint.py", "polyhedron.py", "region.py", "simplex.py"),
        of("tests/qe", "test_region.py", "test_simplex.py"),
    ),
    "eliminate": Part(
        of("robust/qe", "compute.py", "estimate.py", "nnf.py", "region.py", "eliminate/*"),
        of("tests/qe", "backends", "test_region.py"),
        "recorded or sweeps or points_are_inside",
    ),
    "network": Part(("robust/network/*",), ("tests/network",)),
    "encode": Part(("robust/encode/*",), ("tests/encode",), "differential or fixed_schedules_break"),
    "simulator": Part(("robust/plan/simulate.py",), ("tests/plan/test_simulate.py",)),
    "irr": Part(("robust/irr/*",), ("tests/irr",), "recorded or (test_boxes and cvc5)"),
    "certify": Part(("robust/certify/*",), ("tests/certify",)),
    "knowledge": Part(("robust/pike_bridge/knowledge/*",), ("tests/pike_bridge/knowledge",)),
    "options": Part(
        of("robust/options", "declare.py", "shared.py", "verbs.py"),
        of("tests", "test_options.py", "recordings/test_recordings.py"),
        RECORDED,
    ),
}

MAKE = """
import os
from mutmut import __main__ as mutmut
mutmut.set_mutant_under_test("mutant_generation")
os.makedirs("mutants", exist_ok=True)
mutmut.copy_src_dir()
checker = "mutants/robust/certify/checker"  # a link, which is not copied
if not os.path.exists(checker):
    os.symlink("../../proofs/checker", checker)
mutmut.copy_also_copy_files()
mutmut.setup_source_paths()
mutmut.store_lines_covered_by_tests()
mutmut.create_mutants(2)
"""
"""Makes the mutants and runs nothing, for which mutmut has no command."""

RUN = """
import sys
from mutmut import __main__ as mutmut
made = mutmut.get_mutant_runner
def runner(*arguments):
    run = made(*arguments)
    run.run_clean_tests = lambda tests: 0
    return run
mutmut.get_mutant_runner = runner
mutmut.cli(["run", "--max-children", "2", *sys.argv[1:]])
"""
"""Runs mutants, without a second run of all tests on unchanged code: they ran when they were timed."""


def prepare(part):
    """The folder where mutants of the part are made and run: links to the project, with settings of its own."""
    folder = ROOT / "mutants" / part
    folder.mkdir(parents=True, exist_ok=True)
    for name in (CHANGED, *COPIED):
        if not (folder / name).is_symlink():
            (folder / name).symlink_to(ROOT / name)
    for copy in (folder / "mutants" / CHANGED).rglob("*.py"):
        # mutmut looks for changes only in the files of which it makes mutants.
        source = ROOT / copy.relative_to(folder / "mutants")
        if not source.exists() or source.stat().st_mtime > copy.stat().st_mtime:
            copy.unlink()
    code, tests, without = PARTS[part]
    settings = {
        "source_paths": [CHANGED],
        "only_mutate": list(code),
        "also_copy": [*COPIED, "pyproject.toml"],
        "pytest_add_cli_args_test_selection": list(tests),
        "pytest_add_cli_args": ["-p", "no:cacheprovider", *(["-k", f"not ({without})"] if without else [])],
    }
    lines = [f"{key} = {json.dumps(value)}" for key, value in settings.items()]
    lines += ["track_dependencies = false", "use_git_change_detection = false"]
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (folder / "pyproject.toml").write_text("\n".join([project, "[tool.mutmut]", *lines, ""]), encoding="utf-8")
    return folder


def mutmut(folder, code, *arguments):
    """Run the code in the folder. What mutmut writes goes to a file there, its end to stderr if it fails."""
    log = folder / "log.txt"
    settings = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    words = [sys.executable, "-W", "ignore", "-c", code, *arguments]
    with log.open("w", encoding="utf-8") as output:
        streams = {"stdin": subprocess.DEVNULL, "stdout": output, "stderr": subprocess.STDOUT}
        done = subprocess.run(words, cwd=folder, env=settings, check=False, **streams)
    if done.returncode:
        sys.exit(log.read_text(encoding="utf-8")[-4000:] + f"\nmutmut failed in {folder}")


def made(folder):
    """The mutants that there are, with the exit code of their tests if these ran."""
    return {
        name: code
        for path in sorted((folder / "mutants").rglob("*.meta"))
        for name, code in json.loads(path.read_text(encoding="utf-8"))["exit_code_by_key"].items()
    }


def run_blindly(folder, part, names):
    """The exit codes of mutants with all tests of the part, until one fails."""
    command = [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", *PARTS[part].tests]
    command += ["-k", f"not ({PARTS[part].without})"] if PARTS[part].without else []

    def run(name):
        variables = {**os.environ, "MUTANT_UNDER_TEST": name, "PYTHONPATH": str(folder / "mutants")}
        options = {"cwd": folder / "mutants", "env": variables, "capture_output": True, "timeout": PATIENCE}
        try:
            return subprocess.run(command, check=False, **options).returncode
        except subprocess.TimeoutExpired:
            return TIMEOUT[0]

    if names and run(""):
        sys.exit(f"the tests of part {part} fail on unchanged code")
    with ThreadPoolExecutor(2) as pool:
        return dict(zip(names, pool.map(run, names), strict=True))


def change(folder, name):
    """The lines that the mutant takes away (-) and makes (+)."""
    command = [sys.executable, "-W", "ignore", "-m", "mutmut", "show", name]
    shown = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True)
    return [line for line in shown.stdout.splitlines() if line[:1] in ("-", "+") and line[:3] not in ("---", "+++")]


def measure(part, each, seed, only):
    """How many mutants of the part count, and how many of them were noticed; prints this, and those that were not."""
    start = time.monotonic()
    folder = prepare(part)
    mutmut(folder, MAKE)
    names = sorted(fnmatch.filter(made(folder), only))
    sample = random.Random(f"{seed} {part}").sample(names, min(each, len(names)))  # noqa: S311 - no secret
    if not sample:
        return 0, 0
    codes = made(folder)
    for known in (KILLED + TIMEOUT, KILLED + TIMEOUT + UNNOTICED):
        # Where the tests of the part are others than before, the first run forgets what was known.
        if open_ones := [name for name in sample if codes[name] not in known]:
            mutmut(folder, RUN, *open_ones)
            codes = made(folder)
    codes |= run_blindly(folder, part, [name for name in sample if codes[name] in UNNOTICED])
    missed = {name: change(folder, name) for name in sorted(sample) if codes[name] not in KILLED + TIMEOUT}
    lines = ACCEPTED.read_text(encoding="utf-8").splitlines()
    cells = [line.split(" | ") for line in lines if line.strip() and not line.startswith("#")]
    fine = {(function.strip(), changed.strip()) for function, changed, _ in cells}
    unnoticed = {
        name: changes
        for name, changes in missed.items()
        if not any((name.partition("__mutmut_")[0], line[1:].strip()) in fine for line in changes)
    }
    counted = len(sample) - len(missed) + len(unnoticed)
    print(
        f"{part:10} {counted - len(unnoticed):4} of {counted:4} noticed, {len(missed) - len(unnoticed):3} accepted, "
        f"{time.monotonic() - start:6.0f} s",
        flush=True,
    )
    for name, changes in unnoticed.items():
        print("\n        ".join([f"    {name} ({codes[name]})", *changes]), flush=True)
    return counted, counted - len(unnoticed)


def main():
    parser = argparse.ArgumentParser(description="Measure the strength of the quick tests by mutants of the code.")
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--each", type=int, default=65, metavar="N", help="mutants of each part (65)")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="which mutants (0)")
    parser.add_argument("--only", default="*", metavar="PATTERN", help="only mutants with such a name")
    arguments = parser.parse_args()
    parts = arguments.parts or PARTS
    measured = [measure(part, arguments.each, arguments.seed, arguments.only) for part in parts]
    drawn, noticed = map(sum, zip(*measured, strict=True))
    print(f"{'all':10} {noticed:4} of {drawn:4} noticed")
    return 0 if drawn and noticed >= ENOUGH * drawn else 1


if __name__ == "__main__":
    sys.exit(main())
