"""The 600 plans whose correct executions have been counted, and the count of them by each back end.

    python -m benchmarks.conformance.counted write DIRECTORY
    python -m benchmarks.conformance.counted count [--limit SECONDS] [--first N] [--every N] [FILE]

The plans are those of the generator of [PIKE §6.2.2] (`benchmarks/generators/team_plans.py`): 500 random ones, most of
which admit no correct execution, and 100 that admit many. `counts.csv` has what is known of them; `count` counts again,
by five knowledge bases, and ends with code 1 where they or the file disagree.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.compile import Compiling, Temporal, candidate_subplans
from robust.pike_bridge.files import tpnu_text
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.pike_bridge.theory import HasImplicants
from robust.smt.limits import Deadline, OutOfTimeError

from ..generators.team_plans import DEFAULT, FEASIBLE, random_plan

COUNTS = Path(__file__).with_name("counts.csv")
BACKENDS = ("bdd", "pitms", "pitms-labels", "atms", "sat")
RANDOM, MANY = 500, 100
FEWEST, MOST = 50, 120
"""Activities of the plans that admit many executions."""
LISTED = 5000
"""Models that a solver is asked for one by one."""
FIELDS = ("plan", "digest", "activities", "choices", "subplans", "exists", "models", "implicants", "answers")


@dataclass(frozen=True, slots=True)
class Answers:
    """What back ends say: whether an execution exists, and how many models and prime implicants there are; by name."""

    exists: dict[str, bool]
    models: dict[str, int]
    implicants: dict[str, int]

    @property
    def agree(self) -> bool:
        counts = (self.models, self.implicants)
        return len(set(self.exists.values())) <= 1 and all(len(set(known.values())) <= 1 for known in counts)

    @property
    def row(self) -> dict[str, str]:
        """The columns that are answered; `answers` says by how many back ends each."""
        columns: dict[str, Mapping[str, object]] = {}
        columns |= {"exists": self.exists, "models": self.models, "implicants": self.implicants}
        texts = {name: str(next(iter(known.values()), "")).lower() for name, known in columns.items()}
        return texts | {"answers": "/".join(str(len(known)) for known in columns.values())}


def plans() -> Iterator[tuple[str, Instance]]:
    """The 600 plans, by name, in the order of the file."""
    for index in range(RANDOM):
        yield f"random-{index:03}", random_plan(0, index, DEFAULT)
    for index in many():
        yield f"many-{index:03}", random_plan(0, index, FEASIBLE)


@cache
def many() -> tuple[int, ...]:
    """The first plans of the second family of that size which admit an execution."""
    found: list[int] = []
    index = 0
    while len(found) < MANY:
        instance = random_plan(0, index, FEASIBLE)
        if FEWEST <= len(instance.network.activities) <= MOST and _exists(instance.plan()):
            found.append(index)
        index += 1
    return tuple(found)


def _exists(plan: TeamPlan) -> bool:
    return Oracle(plan).decide().verdict is ExecutionExistence.EXISTS


def digest(instance: Instance) -> str:
    """Of the files of a plan."""
    network = tpnu_text(instance.network, domain="domain.pddl", problem="problem.pddl")
    return sha256("\0".join((network, instance.domain, instance.problem)).encode()).hexdigest()[:12]


def answers(plan: TeamPlan, limit: float) -> Answers:
    """What each back end finds out within so many seconds."""
    found = Answers({}, {}, {})
    for backend in BACKENDS:
        deadline = Deadline.after(limit)
        try:
            knowledge = Compiling(plan, backend, Temporal.LAZY, deadline=deadline).compile().knowledge
            found.exists[backend] = knowledge.satisfiable(deadline)
            if isinstance(knowledge, HasImplicants):
                found.implicants[backend] = knowledge.implicant_count(deadline)
            known = max(found.models.values(), default=0)
            if backend != "sat" or known <= LISTED:
                found.models[backend] = knowledge.count_models(deadline)
        except OutOfTimeError:
            continue
    return found


def write(directory: Path) -> None:
    """Write the files of each plan into a folder of its own."""
    for name, instance in plans():
        instance.write(directory / name, name)


def count(path: Path, limit: float, first: int, every: int) -> int:
    """Count again, and write what is known after each plan; how many plans are disagreed about."""
    recorded = {row["plan"]: row for row in _rows(COUNTS)}
    differences = 0
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, FIELDS)
        writer.writeheader()
        for number, (name, instance) in enumerate(plans()):
            if number % every != first:
                continue
            network, found = instance.network, answers(instance.plan(), limit)
            row = {
                "plan": name,
                "digest": digest(instance),
                "activities": str(len(network.activities)),
                "choices": str(len(network.choices)),
                "subplans": str(candidate_subplans(network)),
                **found.row,
            }
            writer.writerow(row)
            file.flush()
            before = recorded.get(name, {})
            changed = [
                field for field in FIELDS[:-1] if row[field] and before.get(field) and row[field] != before[field]
            ]
            if changed or not found.agree:
                differences += 1
                sys.stderr.write(f"{name}: {', '.join(changed)} {found}\n")
    return differences


def _rows(path: Path) -> Sequence[Mapping[str, str]]:
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def main() -> int:
    parser = argparse.ArgumentParser(description="plans whose correct executions are counted")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("write").add_argument("directory", type=Path)
    counting = commands.add_parser("count")
    counting.add_argument("file", type=Path, nargs="?", default=Path("counts.csv"))
    counting.add_argument("--limit", type=float, default=10.0, help="seconds for each back end and plan")
    counting.add_argument("--first", type=int, default=0)
    counting.add_argument("--every", type=int, default=1, help="each so many-th plan, from the first on")
    given = parser.parse_args()
    if given.command == "write":
        write(given.directory)
        return 0
    return int(count(given.file, given.limit, given.first, given.every) > 0)


if __name__ == "__main__":
    sys.exit(main())
