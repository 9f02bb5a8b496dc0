"""The plans of the scaling experiment [IRR Fig. 4]: recorded ones, and our own of any number of parameters."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from robust.errors import InputError, Location
from robust.execute.convert import convert
from robust.execute.delivery import scaling_instance
from robust.execute.parametrization import option_of
from robust.plan.parameters import parse_specs
from robust.plan.pddl.forms import read_text
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import write_stn
from robust.plan.timed import parse_timed_plan

LIST = Path("robot-delivery", "instances.json")
SIZES = tuple(range(1, 34))


class Origin(Enum):
    """Whose plans they are."""

    RECORDED = "recorded"
    OWN = "own"


@dataclass(frozen=True, slots=True)
class Instance:
    """A plan by its texts, so that it can be sent to another machine; `options` are what the plan file cannot say."""

    name: str
    origin: Origin
    parameters: int
    texts: tuple[str, str, str]
    options: tuple[str, ...] = ()

    def write(self, directory: Path) -> tuple[Path, Path, Path]:
        """Write domain, problem and plan into a directory."""
        paths = (directory / "domain.pddl", directory / "problem.pddl", directory / "plan.stn")
        for path, text in zip(paths, self.texts, strict=True):
            path.write_text(text, encoding="utf-8")
        return paths


def recorded_instances(suite: Path) -> tuple[Instance, ...]:
    """The plans that `robot-delivery/instances.json` of a data set lists.

    Raises:
        InputError: if the list or a file that it names is missing or malformed.
    """
    path = suite / LIST
    location = Location(str(path))
    try:
        entries = json.loads(read_text(path))
    except ValueError as error:
        raise InputError(f"not JSON: {error}", location) from None
    if not isinstance(entries, list) or not entries:
        raise InputError("expected a list of at least one instance", location)
    return tuple(_recorded(suite, entry, number, location) for number, entry in enumerate(entries, 1))


def _recorded(suite: Path, entry: object, number: int, location: Location) -> Instance:
    values: dict[str, Any] = entry if isinstance(entry, dict) else {}
    name, *files = [str(values.get(key) or "") for key in ("instance", "domain", "problem", "plan")]
    parameters = values.get("parameters")
    if not name or not all(files) or type(parameters) is not int:
        expected = "'instance', 'domain', 'problem' and 'plan' as texts and 'parameters' as a number"
        raise InputError(f"entry {number}: expected an object with {expected}", location)
    domain, problem, plan = (read_text(suite / file) for file in files)
    return Instance(name, Origin.RECORDED, parameters, (domain, problem, plan))


def own_instance(parameters: int, seed: int) -> Instance:
    """A generated plan of the delivery domain, converted to its least constrained network."""
    made = scaling_instance(parameters, seed)
    domain = parse_domain(made.domain)
    conversion = convert(
        domain, parse_problem(made.problem, domain), parse_timed_plan(made.plan), specs=parse_specs(made.specs)
    )
    found = len(conversion.plan.parameters)
    if found != parameters:
        raise ValueError(f"the instance has {found} parameters, expected {parameters}")
    options = tuple(f"--parameter={option_of(one)}" for one in conversion.beside)
    texts = (made.domain, made.problem, write_stn(conversion.stn))
    return Instance(f"own_{parameters:02}_{seed}", Origin.OWN, parameters, texts, options)
