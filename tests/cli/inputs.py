"""A small plan, whose texts tests change; `tests/recordings/damages.toml` has what makes it wrong."""

from pathlib import Path
from typing import NamedTuple

from tests.recordings.recordings import INPUTS

RIGHT = {
    name: (INPUTS / "small" / name).read_text(encoding="utf-8") for name in ("domain.pddl", "problem.pddl", "plan.stn")
}
DOMAIN, PROBLEM, PLAN = RIGHT.values()


class Inputs(NamedTuple):
    """Where the three texts are."""

    files: tuple[Path, ...]


def write(directory: Path, domain: str = DOMAIN, problem: str = PROBLEM, plan: str = PLAN) -> Inputs:
    inputs = Inputs(tuple(directory / name for name in RIGHT))
    for path, text in zip(inputs.files, (domain, problem, plan), strict=True):
        path.write_text(text, encoding="utf-8")
    return inputs
