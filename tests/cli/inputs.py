"""A small plan, whose texts tests change; `tests/recordings/damages.toml` has what makes it wrong."""

from tests.recordings.recordings import INPUTS

RIGHT = {
    name: (INPUTS / "small" / name).read_text(encoding="utf-8") for name in ("domain.pddl", "problem.pddl", "plan.stn")
}
DOMAIN, PROBLEM, PLAN = RIGHT.values()


def write(directory, domain=DOMAIN, problem=PROBLEM, plan=PLAN):
    """The files with the three texts."""
    files = tuple(directory / name for name in RIGHT)
    for path, text in zip(files, (domain, problem, plan), strict=True):
        path.write_text(text, encoding="utf-8")
    return files
