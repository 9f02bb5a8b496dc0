"""The 700 plans whose correct executions have been counted, and the count of them by each back end.

    python -m benchmarks.conformance.counted write DIRECTORY [--family NAME]
    python -m benchmarks.conformance.counted count [--limit SECONDS] [--family NAME] [--again] [FILE]

The plans are those of the generator of [PIKE §6.2.2] (`benchmarks/generators/team_plans.py`): the first 500 random ones
that every back end has counted, most of which admit no correct execution, 100 that admit few enough for every back end,
and 100 that admit many. `write` writes them with a case for each, which the runner takes: what every correct executive
must do whatever it is free to do. `counts.csv` has what is known of them, and of random ones that take some back end
too long; `count` counts what FILE does not have, by five knowledge bases, and ends with code 1 where they or
`counts.csv` disagree. It can be ended at any time, and goes on where it was.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from io import StringIO
from itertools import chain, count, islice
from pathlib import Path
from typing import Any

from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.compile import Compiling, Temporal, candidate_subplans
from robust.pike_bridge.files import tpnu_text
from robust.pike_bridge.model import TeamPlan
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, holds
from robust.pike_bridge.theory import HasImplicants
from robust.records import atomic_write
from robust.smt.limits import NEVER, OutOfTimeError

from ..generators.team_plans import DEFAULT, FEASIBLE, SMALL, Shape, random_plan

COUNTS = Path(__file__).with_name("counts.csv")
BACKENDS = ("bdd", "pitms", "pitms-labels", "atms", "sat")
RANDOM, CHOSEN = 500, 100
FEWEST, MOST = 50, 120
"""Activities of the plans that admit many executions."""
LEAST = 8
"""Activities of those that admit few."""
LISTED = 1000
"""Models that a solver is asked for one by one."""
COMPLETE = ("5/5/3", "5/4/3")
"""Answers where every back end has said what it can: three know prime implicants, and a solver only lists models."""
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


def random_ones() -> Iterator[tuple[int, Instance]]:
    """Plans as in the paper, without those that took some back end too long when they were counted."""
    hard = {row["plan"] for row in _rows(COUNTS) if row["answers"] not in COMPLETE}
    return ((at, each) for at, each in _drawn(DEFAULT) if f"random-{at:03}" not in hard)


def few() -> Iterator[tuple[int, Instance]]:
    """Plans that admit executions, but not more than can be listed."""
    return ((at, each) for at, each in _drawn(SMALL) if len(each.network.activities) >= LEAST and _listed(each.plan()))


def many() -> Iterator[tuple[int, Instance]]:
    """Large plans that admit executions."""
    sized = ((at, each) for at, each in _drawn(FEASIBLE) if FEWEST <= len(each.network.activities) <= MOST)
    return ((at, each) for at, each in sized if Oracle(each.plan()).decide().verdict is ExecutionExistence.EXISTS)


def _drawn(shape: Shape) -> Iterator[tuple[int, Instance]]:
    return ((index, random_plan(0, index, shape)) for index in count())


def _listed(plan: TeamPlan) -> bool:
    return 0 < Compiling(plan, BACKENDS[0], Temporal.LAZY).compile().knowledge.count_models() <= LISTED


FAMILIES = {"random": random_ones, "few": few, "many": many}
SHAPES = {"random": DEFAULT, "few": SMALL, "many": FEASIBLE}


def plans(families: Iterable[str] = FAMILIES) -> Iterator[tuple[str, Instance]]:
    """The plans of some families, by name, in the order of the file."""
    for family in families:
        for index, instance in islice(FAMILIES[family](), RANDOM if family == "random" else CHOSEN):
            yield f"{family}-{index:03}", instance


def digest(instance: Instance) -> str:
    """Of the files of a plan."""
    network = tpnu_text(instance.network, domain="domain.pddl", problem="problem.pddl")
    return sha256("\0".join((network, instance.domain, instance.problem)).encode()).hexdigest()[:12]


def answers(plan: TeamPlan, limit: float) -> Answers:
    """What each back end finds out within so many seconds of processor time."""
    found = Answers({}, {}, {})
    for backend in BACKENDS:
        deadline = NEVER.within(limit)
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


def write(directory: Path, families: Iterable[str]) -> None:
    """Write each plan with its case, as the runner takes them."""
    (directory / "cases").mkdir(parents=True, exist_ok=True)
    impossible = {row["plan"] for row in _rows(COUNTS) if row["exists"] == "false"}
    for name, instance in plans(families):
        instance.write(directory / "plans" / name, name)
        plan = instance.plan()
        execution = None if name in impossible else Oracle(plan).decide().witness
        atomic_write(directory / "cases" / f"{name}.json", json.dumps(case(name, plan, execution), indent=1), None)


def case(name: str, plan: TeamPlan, execution: Execution | None) -> dict[str, Any]:
    """What a world says to an executive of a plan, and what comes of it.

    If no correct execution exists, that is said at once. Otherwise people tell at the beginning what they choose in a
    correct one, with which something is left; activities take their least time, which need not leave anything.
    """
    common = {"level": "core", "plan": name, "until": "1000"}
    if execution is None:
        about = "no correct execution exists: that is said before anything begins"
        return {**common, "about": about, "world": [], "must not": [{"kind": "dispatched"}], "outcome": ["failed"]}
    network, scenario = plan.network, execution.scenario
    made = [each for each in network.choices if each.event is None or holds(network.guards[each.event], scenario)]
    outcomes = [
        {"kind": "outcome", "choice": each.name, "value": scenario[each.name]} for each in made if not each.controllable
    ]
    ends = {(each.action, each.target): each for each in network.activities}.values()
    world: list[dict[str, Any]] = [{"time": "0", "messages": outcomes}] if outcomes else []
    world += (
        {
            "when": {"kind": "dispatched", "action": each.action, "end": each.target},
            "after": str(each.lower),
            "messages": [{"kind": "completion", "action": each.action, "event": each.target}],
        }
        for each in ends
    )
    about = "people choose at once what leaves a correct execution: nothing has failed then"
    must = {"must not": [{"kind": "failed", "until": "0"}], "outcome": ["succeeded", "failed"]}
    return {**common, "about": about, "world": world, **must}


def recount(path: Path, limit: float, families: Iterable[str], *, again: bool) -> int:
    """Count what a file does not have, and write it after each plan; how many plans are disagreed about.

    Args:
        again: whether plans are counted anew that fewer back ends have answered for than can be.
    """
    recorded, rows = ({row["plan"]: row for row in _rows(each)} for each in (COUNTS, path))
    hard = [name for name, row in rows.items() if again and row["answers"] not in COMPLETE]
    anew = (_named(name) for name in hard if name.split("-")[0] in families)
    differences = 0
    for name, instance in chain((each for each in plans(families) if each[0] not in rows), anew):
        network, found = instance.network, answers(instance.plan(), limit)
        row = {
            "plan": name,
            "digest": digest(instance),
            "activities": str(len(network.activities)),
            "choices": str(len(network.choices)),
            "subplans": str(candidate_subplans(network)),
            **found.row,
        }
        before = [known[name] for known in (recorded, rows) if name in known]
        changed = [
            field for field in FIELDS[:-1] for each in before if row[field] and each[field] not in {"", row[field]}
        ]
        if changed or not found.agree:
            differences += 1
            sys.stderr.write(f"{name}: {', '.join(changed)} {found}\n")
        if name not in rows or _answered(row) >= _answered(rows[name]):
            rows[name] = row
        text = StringIO()
        writer = csv.DictWriter(text, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[name] for name in sorted(rows, key=_place))
        atomic_write(path, text.getvalue(), None)
    return differences


def _named(name: str) -> tuple[str, Instance]:
    family, index = name.split("-")
    return name, random_plan(0, int(index), SHAPES[family])


def _place(name: str) -> tuple[int, int]:
    """Where a plan is in the file."""
    family, index = name.split("-")
    return list(FAMILIES).index(family), int(index)


def _answered(row: Mapping[str, str]) -> int:
    return sum(map(int, row["answers"].split("/")))


def _rows(path: Path) -> Sequence[Mapping[str, str]]:
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def main() -> int:
    parser = argparse.ArgumentParser(description="plans whose correct executions are counted")
    commands = parser.add_subparsers(dest="command", required=True)
    writing, counting = commands.add_parser("write"), commands.add_parser("count")
    writing.add_argument("directory", type=Path)
    counting.add_argument("file", type=Path, nargs="?", default=Path("counts.csv"))
    counting.add_argument(
        "--limit", type=float, default=10.0, help="seconds of processor time, for each back end and plan"
    )
    for each in (writing, counting):
        each.add_argument("--family", choices=FAMILIES, action="append", help="of plans (default: all)")
    counting.add_argument("--again", action="store_true", help="count anew where back ends gave no answer before")
    given = parser.parse_args()
    if given.command == "write":
        write(given.directory, given.family or FAMILIES)
        return 0
    return int(recount(given.file, given.limit, given.family or FAMILIES, again=given.again) > 0)


if __name__ == "__main__":
    sys.exit(main())
