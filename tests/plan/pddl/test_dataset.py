"""The recorded instances are read, and every action that their plans use is ground."""

import json
import re
from pathlib import Path
from time import perf_counter

from robust.plan.pddl.grounding import fluents_read, ground_action, ground_goal, initial_fluents
from robust.plan.pddl.reader import read_domain, read_problem

INSTANCE = re.compile(r"^(durative-)?action instance (\S+)\s*:\s*\(([^)]*)\)", re.MULTILINE)


def test_all_problems(dataset: Path) -> None:
    problems = [path for path in sorted(dataset.glob("*/*.pddl")) if path.name != "domain.pddl"]
    assert len(problems) > 30
    for path in problems:
        domain = read_domain(path.parent / "domain.pddl")
        started = perf_counter()
        problem = read_problem(path, domain)
        assert perf_counter() - started < 20
        assert problem.atoms
        assert ground_goal(domain, problem)


def records(dataset: Path) -> list[dict[str, str]]:
    tables = (dataset / "recorded-results.json", dataset / "robot-delivery" / "instances.json")
    return [record for table in tables for record in json.loads(table.read_text())]


def test_all_plans(dataset: Path) -> None:
    ground = 0
    for record in records(dataset):
        domain = read_domain(dataset / record["domain"])
        problem = read_problem(dataset / record["problem"], domain)
        for durative, identifier, words in INSTANCE.findall((dataset / record["plan"]).read_text()):
            action, *arguments = words.split()
            instance = ground_action(domain, problem, identifier, action, arguments, bool(durative), None)
            assert instance.conditions
            assert fluents_read(instance) <= initial_fluents(domain, problem).keys()
            ground += 1
    assert ground > 200
