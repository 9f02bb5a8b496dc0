"""How strong the quick tests are: small changes to the code, each of which some test should notice.

    python -m tests.mutants [--each N] [--seed S] [--only PATTERN]

Draws N mutants of every part below from those that mutmut makes, runs for each the tests that call what was changed,
and prints a table of how many were noticed, with the name of every one that was not; `mutmut show NAME` prints its
change. Exit code 1 if fewer than 90 % were. The working copy is `mutants/`, which mutmut keeps for the next run.
"""

import argparse
import fnmatch
import json
import random
import subprocess
import sys
from collections import Counter
from pathlib import Path

PARTS = {
    "qe": "robust.qe.*",
    "irr": "robust.irr.*",
    "encode": "robust.encode.*",
    "simulator": "robust.plan.simulate.*",
    "certify": "robust.certify.*",
    "knowledge": "robust.pike_bridge.knowledge.*",
    "options": "robust.options.*",
}
KILLED = (1, 3)
"""Exit codes of pytest where a test failed, or could not even start."""
TIMEOUT = (24, 36, -24, 152, 255)
ENOUGH = 0.9
MUTMUT = (sys.executable, "-W", "ignore", "-m", "mutmut", "run", "--max-children", "2")


def made() -> dict[str, int | None]:
    """The mutants that there are, with the exit code of their tests if these ran."""
    return {
        name: code
        for path in sorted(Path("mutants").rglob("*.meta"))
        for name, code in json.loads(path.read_text(encoding="utf-8"))["exit_code_by_key"].items()
    }


def drawn(names: list[str], each: int, seed: int, only: str) -> dict[str, list[str]]:
    """By part, a sample of the mutants that is the same for the same code and seed."""
    chosen = {}
    for part, pattern in PARTS.items():
        of_part = sorted(name for name in fnmatch.filter(names, pattern) if fnmatch.fnmatch(name, only))
        chosen[part] = random.Random(f"{seed} {part}").sample(of_part, min(each, len(of_part)))  # noqa: S311 - no secret
    return chosen


def main() -> int:
    parser = argparse.ArgumentParser(description="Measure the strength of the quick tests by mutants of the code.")
    parser.add_argument("--each", type=int, default=65, metavar="N", help="mutants of each part (65)")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="which mutants (0)")
    parser.add_argument("--only", default="*", metavar="PATTERN", help="only mutants with such a name")
    arguments = parser.parse_args()
    if not made():
        # There is no call that only makes mutants: this one makes them, times the tests, and then finds none to run.
        subprocess.run([*MUTMUT, "none"], check=False)
    sample = drawn(list(made()), arguments.each, arguments.seed, arguments.only)
    subprocess.run([*MUTMUT, *(name for names in sample.values() for name in names)], check=False)
    codes = made()
    totals: Counter[str] = Counter()
    for part, names in sample.items():
        noticed = [name for name in names if codes[name] in KILLED or codes[name] in TIMEOUT]
        totals.update(all=len(names), noticed=len(noticed))
        print(f"{part:12} {len(noticed):4} of {len(names):4} noticed")
        for name in sorted(set(names) - set(noticed)):
            print(f"    {name} ({codes[name]})")
    print(f"{'all':12} {totals['noticed']:4} of {totals['all']:4} noticed")
    return 0 if totals["all"] and totals["noticed"] >= ENOUGH * totals["all"] else 1


if __name__ == "__main__":
    sys.exit(main())
