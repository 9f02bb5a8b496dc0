"""Documentation is true: documented commands print what is shown, links resolve, the architecture page is complete.

`python -m tests.test_documentation [PAGE...]` writes anew what is shown where commands print something else by now.

A `console` block is a session: lines that begin with `$ ` are commands (continued after a backslash), the others are
what they print on standard output. A line `...` stands for any lines. Times are not compared. Each block is run in a
directory of its own; but a page that shows files (a line with the name in backquotes and a colon, then a block) is one
session, in a directory with these files.
"""

import ast
import importlib.util
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from robust.cli.build import Command
from robust.cli.main import run_command
from robust.options.declare import declared

ROOT = Path(__file__).resolve().parents[1]


def module_at(path: str):
    """A module that is no part of a package."""
    specification = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


reference = module_at("docs/extensions/reference.py")
MARK = "=== next command ==="
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks").rglob("*.md")])
IDS = [str(page.relative_to(ROOT)) for page in PAGES]


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


# -- documented commands ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Session:
    """A `console` block, or all of a page: commands with the lines that they are said to print."""

    page: Path
    line: int
    steps: tuple[tuple[str, tuple[str, ...]], ...]
    files: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def sessions() -> list[Session]:
    return [session for page in PAGES for session in sessions_of(page)]


def sessions_of(page: Path) -> list[Session]:
    text = page.read_text(encoding="utf-8")
    blocks = re.finditer(r"^```console\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    found = [Session(page, text.count("\n", 0, block.start()) + 1, steps_of(block[1])) for block in blocks]
    files = re.findall(r"^`([\w.]+)`:\n\n```\w*\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    if not files:
        return found
    return [Session(page, found[0].line, sum((each.steps for each in found), ()), tuple(files))]


def steps_of(block: str) -> tuple[tuple[str, tuple[str, ...]], ...]:
    steps: list[tuple[str, list[str]]] = []
    for line in block.replace("\\\n", " ").splitlines():
        if line.startswith("$ "):
            steps.append((line[2:], []))
        else:
            steps[-1][1].append(line)
    return tuple((command, tuple(lines)) for command, lines in steps)


def run(session: Session, directory: Path, robust: Sequence[str] = (sys.executable, "-m", "robust")) -> list[str]:
    """What each command of the session prints, run in a directory that looks like the checkout."""
    for name in ("robust", "benchmarks", "docs"):
        (directory / name).symlink_to(ROOT / name)
    for name, text in session.files:
        (directory / name).write_text(text, encoding="utf-8")
    script = [f'robust() {{ {shlex.join(robust)} "$@"; }}', f'python3() {{ "{sys.executable}" "$@"; }}', "shown=0"]
    for command, _ in session.steps:
        # `$?` is that of the command before, as in a terminal.
        script += [f"echo '{MARK}'", "(exit $shown)", command, "shown=$?"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb"}
    environment.pop("FORCE_COLOR", None)
    result = subprocess.run(
        ["bash", "-c", "\n".join(script)],
        capture_output=True,
        text=True,
        cwd=directory,
        env=environment,
        timeout=300,
        check=False,
    )
    assert "Traceback" not in result.stderr, result.stderr
    assert "No such" not in result.stderr, result.stderr
    return result.stdout.split(f"{MARK}\n")[1:]


def normalised(line: str) -> str:
    """Without what differs from run to run and from terminal to terminal: times, frames, spaces."""
    line = re.sub(r"[─│╭╮╰╯┃━┏┓┡┩┗┛┳╇┴┬┼├┤]", " ", line)
    line = re.sub(r'("(?:[a-z_]*seconds|[a-z_]*_s)"): [0-9.e+-]+', r"\1: TIME", line)
    line = re.sub(r"\b[0-9]+(?:\.[0-9]+)? ?(?:s|ms|seconds)\b", "TIME", line)
    return " ".join(line.split())


def pattern(lines: tuple[str, ...]) -> str:
    parts = [".*" if line.strip() == "..." else re.escape(normalised(line)) + "\n" for line in lines if line.strip()]
    return "".join(parts)


def shown(expected: tuple[str, ...], printed: str) -> bool:
    found = "".join(f"{normalised(line)}\n" for line in printed.splitlines() if normalised(line))
    wanted = pattern(tuple(line for line in expected if normalised(line)))
    return re.fullmatch(wanted, found, re.DOTALL) is not None


@pytest.mark.parametrize("session", sessions(), ids=str)
def test_documented_commands_print_what_is_shown(session, tmp_path, warm):
    for (command, expected), printed in zip(session.steps, run(session, tmp_path, warm), strict=True):
        assert shown(expected, printed), f"{session}: {command}\nprints\n{printed}"


def rewritten(page: Path) -> str:
    """The page with what its commands print now, but for what is shown in part."""
    text = page.read_text(encoding="utf-8")
    for session in sessions_of(page):
        with TemporaryDirectory() as directory:
            found = run(session, Path(directory))
        for (_, expected), printed in zip(session.steps, found, strict=True):
            if "..." not in expected and not shown(expected, printed):
                lines = [line.rstrip() for line in printed.strip("\n").splitlines()]
                text = text.replace("\n".join(expected), "\n".join(lines), 1)
    return text


def test_every_command_has_its_section_and_its_options():
    """The options themselves come from the code when the page is built; none are copied here."""
    page = read("docs/commands.md")
    for name in ["robust", *reference.commands()]:
        assert f"\n## {name}\n" in page, name
        assert f"\n```{{command}} {name}\n```\n" in page, name
    assert "--help\n" not in page


@pytest.mark.parametrize("name", [name for name, entry in reference.commands().items() if isinstance(entry, Command)])
def test_the_reference_says_what_help_says(name):
    """Names, values, help texts and defaults, of which help breaks the lines elsewhere."""
    with redirect_stdout(StringIO()) as stream:
        assert run_command([*name.split()[1:], "--help"]) == 0
    squeezed = re.sub(r"[\s,/<>.|\[\]{}-]", "", stream.getvalue())
    for option, one in declared(reference.commands()[name].load().options).items():
        for text in (reference.typed(option, one), reference.told(one).removesuffix("(required)")):
            assert re.sub(r"[\s,/<>.|\[\]{}-]", "", text.split(" [default")[0]) in squeezed, (name, text)


def test_the_readme_shows_commands_with_their_output():
    shown = [command for session in sessions_of(ROOT / "README.md") for command, _ in session.steps]
    assert [command for command in shown if command.startswith("robust check ")]
    assert [command for command in shown if command.startswith("robust envelope ")]


def test_ci_runs_the_test_command_of_the_readme():
    commands = re.findall(r"\.venv/bin/(python -m pytest[^`\n]*)", read("README.md"))
    assert commands
    assert {command.strip() for command in commands} <= {line.strip() for line in read(".ci/run").splitlines()}


def test_contributing_and_justfile_have_the_same_commands():
    recipes = set(re.findall(r"^    \{\{python\}\} (-m .*?)(?: \{\{arguments\}\})?$", read("justfile"), re.MULTILINE))
    table = read("CONTRIBUTING.md").split("## Commands")[1].split("\n## ")[0]
    documented = set(re.findall(r"`python (-m [^`]*)`", table))
    installation = {recipe for recipe in recipes if recipe.startswith("-m pip")}
    assert recipes - installation == documented


@pytest.mark.parametrize("name", re.findall(r"^\[parameters.*?(?=^```)", read("docs/formats.md"), re.M | re.S)[:1])
def test_documented_parameter_file_is_read(name, tmp_path):
    from robust.plan.load import load_plan  # noqa: PLC0415 - needed here only

    path = tmp_path / "parameters.toml"
    path.write_text(name, encoding="utf-8")
    files = [
        ROOT / "robust/examples/two_sample_navigation" / name for name in ("domain.pddl", "problem.pddl", "plan.stn")
    ]
    plan = load_plan(*files, parameter_file=path)
    assert [parameter.name for parameter in plan.parameters] == ["to_ridge", "to_crater", "endurance"]


PYTHON = [
    "README.md",
    "docs/api.md",
    "docs/choices.md",
    "docs/executives.md",
    "docs/stnu.md",
    "docs/how-to/plan-with-choices.md",
]


@pytest.mark.parametrize("page", PYTHON)
def test_documented_python_says_what_is_so(page, monkeypatch, tmp_path):
    """Each line `expression  # Value` evaluates to something that is written like that value; a guide goes on."""
    (tmp_path / "robust").symlink_to(ROOT / "robust")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```$", read(page), re.MULTILINE | re.DOTALL)
    assert blocks
    names: dict[str, object] = {}
    for block in blocks:
        if "how-to" not in page:
            names = {}
        lines = block.splitlines()
        for statement in ast.parse(block).body:
            code = ast.get_source_segment(block, statement)
            _, _, comment = lines[statement.end_lineno - 1][statement.end_col_offset :].partition("  # ")
            if not comment:
                exec(code, names)  # noqa: S102 - our own documentation
                continue
            claimed = comment.split(":")[0].split(",")[0].strip()
            assert str(eval(code, names)) == claimed, code  # noqa: S307 - our own documentation


# -- notebooks -------------------------------------------------------------------------------------------------------

NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))


def cells(notebook: Path) -> list[dict]:
    return [cell for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]


PRINTED = {
    "unified-planning.ipynb": [
        "gap 1/100, epsilon 1/10: INVALID",
        "gap 1/100, epsilon 1/1000: VALID",
        "gap 1/100000, epsilon 1/10: INVALID",
        "gap 1/100000, epsilon 1/1000: INVALID",
        "STNPlan VALID",
    ]
}
"""What text of a notebook promises: ε beside gaps, of which unified-planning's own validator gets some cells wrong."""


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_runs_from_any_directory_and_keeps_no_output(notebook, tmp_path):
    assert [cell for cell in cells(notebook) if cell["outputs"] or cell["execution_count"]] == []
    script = "\n\n".join("".join(cell["source"]) for cell in cells(notebook))
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"}
    words = [sys.executable, "-W", "error", "-c", script]
    ended = subprocess.run(
        words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.splitlines() == PRINTED.get(notebook.name, ended.stdout.splitlines())


def test_notebooks_whose_text_promises_something_are_there():
    assert set(PRINTED) <= {notebook.name for notebook in NOTEBOOKS}


# -- links -----------------------------------------------------------------------------------------------------------


def anchors(page: Path) -> set[str]:
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_internal_links_resolve(page):
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"`[^`\n]*`", "", text)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{page.name} links to {target}"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{page.name} links to {target}"


# -- the architecture page -------------------------------------------------------------------------------------------


def test_the_architecture_fits_in_a_head_and_names_what_exists():
    page = read("ARCHITECTURE.md")
    assert len(page.splitlines()) < 200
    for name in re.findall(r"`((?:robust|benchmarks|tests|proofs)/[a-z0-9_/]*(?:\.py)?)`", page):
        assert (ROOT / name).exists(), name


if __name__ == "__main__":
    for each in [Path(name) for name in sys.argv[1:]] or PAGES:
        each.write_text(rewritten(each), encoding="utf-8")
