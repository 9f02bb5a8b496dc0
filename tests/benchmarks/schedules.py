"""A plan file and VAL, without the package: nominal values in, earliest schedule out, one schedule validated.

But for what starts VAL, this shares no code with the readers and the simulator that it is compared with.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from networkx import MultiDiGraph, single_source_bellman_ford_path_length

from tests.pddl_text import PddlText
from tests.val import run_val

Schedule = dict[str, Fraction]


class Edge(NamedTuple):
    """At least `least` and at most `most` from `source` to `target`; None is unbounded."""

    source: str
    target: str
    least: Fraction | None
    most: Fraction | None


class PlanFile(NamedTuple):
    parameters: dict[str, Fraction]
    instances: dict[str, str]
    edges: list[Edge]


def read_plan(path: Path, values: Mapping[str, Fraction] | None = None) -> PlanFile:
    """The statements of a `.stn` file, at the nominal parameter values unless `values` says otherwise."""
    text = re.sub(r"#.*", "", path.read_text(encoding="utf-8"))
    parameters: dict[str, Fraction] = {}
    instances: dict[str, str] = {}
    edges: list[tuple[str, str, str, str]] = []
    for statement in filter(None, map(str.strip, text.split(";"))):
        if match := re.fullmatch(r"parameter (\S+)(?: weight \S+)? default (\S+)", statement):
            parameters[match[1]] = Fraction(match[2])
        elif match := re.fullmatch(r"durative-action instance (\S+) : (\(.*\))", statement):
            instances[match[1]] = match[2]
        elif match := re.fullmatch(r"c: (\S+) - (\S+) in \[(\S+), (\S+)\]", statement):
            edges.append((match[2], match[1], match[3], match[4]))
        else:
            raise AssertionError(f"{path}: {statement}")
    parameters.update(values or {})

    def bound(word: str) -> Fraction | None:
        if word in {"inf", "-inf"}:
            return None
        return parameters[word] if word in parameters else Fraction(word)

    read = [Edge(source, target, bound(least), bound(most)) for source, target, least, most in edges]
    return PlanFile(parameters, instances, read)


def earliest(plan: PlanFile, extra: Iterable[Edge] = ()) -> Schedule:
    """The earliest time of every time point: longest paths from zero, unbounded if the constraints have no schedule."""
    graph = MultiDiGraph()
    for name in plan.instances:
        graph.add_weighted_edges_from((".zero", f"{name}.{end}", Fraction(0)) for end in ("start", "end"))
    for edge in (*plan.edges, *extra):
        if edge.least is not None:
            graph.add_edge(edge.source, edge.target, weight=-edge.least)
        if edge.most is not None:
            graph.add_edge(edge.target, edge.source, weight=edge.most)
    return {point: -length for point, length in single_source_bellman_ford_path_length(graph, ".zero").items()}


def for_val(domain: str, plan: PlanFile, schedule: Schedule) -> tuple[str, dict[str, str]]:
    """The domain with every instance's own copy of its action, and the instances' actions in it.

    Numbers replace what VAL cannot read: `:synth-parameters`, and `?duration` in conditions.
    """
    domain = re.sub(r";.*", "", domain)
    if match := re.search(r"\(:synth-parameters([^)]*)\)", domain):
        domain = domain.replace(match[0], "")
        for variable in match[1].split():
            domain = substitute(domain, variable, plan.parameters[variable[1:]])
    head, *actions = re.split(r"(?=\(:durative-action )", domain.rstrip().removesuffix(")"))
    texts = {action.split()[1]: action for action in actions}
    result, names = [head], {}
    for identifier, instance in plan.instances.items():
        name = instance[1:].split()[0].rstrip(")")
        copy = texts[name].replace(name, f"{name}-{identifier}", 1)
        if match := re.search(r":synth-parameters \(([^)]*)\)", copy):
            copy = copy.replace(match[0], "")
            for variable in match[1].split():
                copy = substitute(copy, variable, plan.parameters[f"{identifier}.{variable[1:]}"])
        declaration, body = copy.split(":condition")
        body = substitute(body, "?duration", schedule[f"{identifier}.end"] - schedule[f"{identifier}.start"])
        result.append(f"{declaration}:condition{body}")
        names[identifier] = instance.replace(name, f"{name}-{identifier}", 1)
    return "".join(result) + ")", names


def substitute(text: str, variable: str, value: Fraction) -> str:
    """The number in place of the variable."""
    return re.sub(rf"{re.escape(variable)}(?![\w-])", decimal(value), text)


def decimal(value: Fraction) -> str:
    """The number written as a decimal; all numbers here are finite ones."""
    text = Decimal(value.numerator) / Decimal(value.denominator)
    assert Fraction(text) == value
    return f"{text:f}"


def val_accepts(domain: Path, problem: Path, plan: PlanFile, schedule: Schedule) -> bool:
    """Does VAL find the plan valid when it is executed at these times."""
    text, names = for_val(domain.read_text(encoding="utf-8"), plan, schedule)
    timed = "".join(
        f"{decimal(schedule[f'{i}.start'])}: {action} [{decimal(schedule[f'{i}.end'] - schedule[f'{i}.start'])}]\n"
        for i, action in names.items()
    )
    found = run_val(PddlText(text, problem.read_text(encoding="utf-8"), timed), tolerance=Fraction("0.0005"))
    assert "Bad" not in found.report, found.report  # VAL exits with 0 when it cannot read a plan
    assert ("Plan valid" in found.report) is found.valid, found.report
    return found.valid
