"""Documentation is true: documented commands print what is shown, links resolve, the architecture page is complete.

`python -m tests.test_documentation [PAGE...]` writes anew what is shown where commands print something else by now,
`python -m tests.notebooks` the outputs of notebooks.

A `console` block is a session: lines that begin with `$ ` are commands (continued after a backslash), the others are
what they print on standard output. A line `...` stands for any lines. Times are not compared. Each block is run in a
directory of its own; but a page that shows files (a line with the name in backquotes and a colon, then a block) is one
session, in a directory with these files.
"""

import ast
import importlib.util
import json
import re
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

import robust
from robust.cli.build import Command
from robust.options.declare import declared
from tests.cli.running import COMMAND, command, environment, example, ran
from tests.cli.running import REPOSITORY as ROOT
from tests.notebooks import NOTEBOOKS, executed, texts

SPECIFICATION = importlib.util.spec_from_file_location("reference", ROOT / "docs/extensions/reference.py")
reference = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(reference)
MARK = "=== next command ==="
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks").rglob("*.md")])
MULTILINE = re.MULTILINE | re.DOTALL


def read(name):
    return (ROOT / name).read_text(encoding="utf-8")


@dataclass(frozen=True)
class Session:
    """A `console` block, or all of a page: commands with the lines that they are said to print."""

    page: Path
    line: int
    steps: tuple[tuple[str, tuple[str, ...]], ...]
    files: tuple[tuple[str, str], ...] = ()

    def __str__(self):
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def sessions_of(page):
    text = read(page)
    blocks = re.finditer(r"^```console\n(.*?)^```$", text, MULTILINE)
    sessions = [Session(page, text.count("\n", 0, block.start()) + 1, steps_of(block[1])) for block in blocks]
    files = re.findall(r"^`([\w.]+)`:\n\n```\w*\n(.*?)^```$", text, MULTILINE)
    if not files:
        return sessions
    return [Session(page, sessions[0].line, sum((session.steps for session in sessions), ()), tuple(files))]


def steps_of(block):
    steps = []
    for line in block.replace("\\\n", " ").splitlines():
        if line.startswith("$ "):
            steps.append((line[2:], []))
        else:
            steps[-1][1].append(line)
    return tuple((line, tuple(lines)) for line, lines in steps)


# Executives that look ahead may take any time for a step: on a busy machine, what is shown may take more than 0.1 s.
GENEROUS = 'case "$*" in *--budget* | *kirk*) ;; "pike run "*) set -- "$@" --budget 60 ;; esac'


def run(session, directory, robust=COMMAND):
    """What each command of the session prints, run in a directory that looks like the checkout."""
    for name in ("robust", "benchmarks", "docs"):
        (directory / name).symlink_to(ROOT / name)
    for name, text in session.files:
        (directory / name).write_text(text, encoding="utf-8")
    script = [
        f'robust() {{ {GENEROUS}\n {shlex.join(robust)} "$@"; }}',
        f'python3() {{ "{sys.executable}" "$@"; }}',
        "shown=0",
    ]
    for line, _ in session.steps:
        # `$?` is that of the command before, as in a terminal.
        script += [f"echo '{MARK}'", "(exit $shown)", line, "shown=$?"]
    variables = environment(COLUMNS="100", NO_COLOR="1", TERM="dumb")
    variables.pop("FORCE_COLOR", None)
    ended = ran("bash", "-c", "\n".join(script), cwd=directory, env=variables, timeout=300)
    assert not re.search("Traceback|No such", ended.err), ended.err
    return ended.out.split(f"{MARK}\n")[1:]


def normalised(line):
    """Without what differs from run to run and from terminal to terminal: times, frames, spaces, slow steps."""
    line = re.sub(r"[─│╭╮╰╯┃━┏┓┡┩┗┛┳╇┴┬┼├┤]", " ", line)
    line = re.sub(r'("(?:[a-z_]*seconds|[a-z_]*_s)"): [0-9.e+-]+', r"\1: TIME", line)
    line = re.sub(r"\b[0-9]+(?:\.[0-9]+)? ?(?:s|ms|seconds)\b", "TIME", line)
    line = re.sub(r"^[0-9]+ of [0-9]+ steps were not decided within their budget.*", "", line)
    return " ".join(line.split())


def shown(expected, printed):
    lines = [line for line in map(normalised, expected) if line]
    wanted = "".join(".*" if line == "..." else re.escape(line) + "\n" for line in lines)
    text = "".join(f"{line}\n" for line in map(normalised, printed.splitlines()) if line)
    return re.fullmatch(wanted, text, re.DOTALL) is not None


@pytest.mark.parametrize("session", [session for page in PAGES for session in sessions_of(page)], ids=str)
def test_documented_commands_print_what_is_shown(session, tmp_path, warm):
    for (line, expected), printed in zip(session.steps, run(session, tmp_path, warm), strict=True):
        assert shown(expected, printed), f"{session}: {line}\nprints\n{printed}"


def rewritten(page):
    """The page with what its commands print now, but for what is shown in part."""
    text = read(page)
    for session in sessions_of(page):
        with TemporaryDirectory() as directory:
            outputs = run(session, Path(directory))
        for (_, expected), printed in zip(session.steps, outputs, strict=True):
            if "..." not in expected and not shown(expected, printed):
                lines = [line.rstrip() for line in printed.strip("\n").splitlines()]
                text = text.replace("\n".join(expected), "\n".join(lines), 1)
    return text


@pytest.mark.parametrize("name", [name for name, entry in reference.commands().items() if isinstance(entry, Command)])
def test_the_reference_says_what_help_says(name):
    """Names, values, help texts and defaults, of which help breaks the lines elsewhere."""
    ended = command(*name.split()[1:], "--help")
    assert ended.code == 0
    squeezed = re.sub(r"[\s,/<>.|\[\]{}-]", "", ended.out)
    for option, kind in declared(reference.commands()[name].load().options).items():
        for text in (reference.typed(option, kind), reference.told(kind).removesuffix("(required)")):
            assert re.sub(r"[\s,/<>.|\[\]{}-]", "", text.split(" [default")[0]) in squeezed, (name, text)


def test_pages_scripts_and_the_architecture_name_what_exists():
    """The options of commands come from the code when the page is built; none are copied there."""
    page = read("docs/commands.md")
    for name in ["robust", *reference.commands()]:
        assert f"\n## {name}\n" in page, name
        assert f"\n```{{command}} {name}\n```\n" in page, name
    assert "--help\n" not in page
    steps = [line for session in sessions_of(ROOT / "README.md") for line, _ in session.steps]
    assert {line.split()[1] for line in steps if line.startswith("robust ")} >= {"check", "envelope"}
    testing = {line.strip() for line in re.findall(r"\.venv/bin/python (-m pytest[^`\n]*)", read("README.md"))}
    recipes = set(re.findall(r"^    \{\{python\}\} (-m .*?)(?: \{\{arguments\}\})?$", read("justfile"), re.MULTILINE))
    assert testing & recipes == testing != set()
    table = read("CONTRIBUTING.md").split("## Commands")[1].split("\n## ")[0]
    installation = {recipe for recipe in recipes if recipe.startswith("-m pip")}
    assert recipes - installation == set(re.findall(r"`python (-m [^`]*)`", table))
    page = read("ARCHITECTURE.md")
    assert len(page.splitlines()) < 200
    for name in re.findall(r"`((?:robust|benchmarks|tests|proofs)/[a-z0-9_/]*(?:\.py)?)`", page):
        assert (ROOT / name).exists(), name
    assert set(PRINTED) <= {notebook.name for notebook in NOTEBOOKS}


def test_documented_parameter_file_is_read(tmp_path):
    block = re.search(r"^\[parameters.*?(?=^```)", read("docs/formats.md"), MULTILINE)
    path = tmp_path / "parameters.toml"
    path.write_text(block[0], encoding="utf-8")
    plan = robust.load_plan(*example(), parameter_file=path)
    assert [parameter.name for parameter in plan.parameters] == ["to_ridge", "to_crater", "endurance"]


PYTHON = [
    "README.md",
    *(f"docs/{name}.md" for name in ("api", "choices", "executives", "stnu", "how-to/plan-with-choices")),
]


@pytest.mark.parametrize("page", PYTHON)
def test_documented_python_says_what_is_so(page, monkeypatch, tmp_path):
    """Each line `expression  # Value` evaluates to something that is written like that value; a guide goes on."""
    (tmp_path / "robust").symlink_to(ROOT / "robust")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```$", read(page), MULTILINE)
    assert blocks
    names = {}
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


PRINTED = {
    "unified-planning.ipynb": [
        "gap 1/100, epsilon 1/10: INVALID",
        "gap 1/100, epsilon 1/1000: VALID",
        "gap 1/100000, epsilon 1/10: INVALID",
        "gap 1/100000, epsilon 1/1000: INVALID",
        "STNPlan VALID",
        "dur_n0 ∈ [0, 39999/1000], dur_n1 ∈ [0, 40001/1000]",
        "STNPlan VALID",
    ]
}
"""What text of a notebook promises: ε beside gaps, of which unified-planning's own validator gets some cells wrong."""


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_runs_from_any_directory_and_keeps_what_it_prints(notebook, tmp_path):
    document, ended = executed(notebook, tmp_path)
    assert (ended.code, ended.err) == (0, "")
    printed = texts(document)
    assert printed == texts(json.loads(read(notebook)))
    if notebook.name in PRINTED:
        assert "".join(printed).splitlines() == PRINTED[notebook.name]


def prose(page):
    return re.sub(r"^```.*?^```$", "", read(page), flags=MULTILINE)


def anchors(page):
    headings = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_internal_links_resolve(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", prose(page))):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{page.name} links to {target}"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{page.name} links to {target}"


if __name__ == "__main__":
    for each in [Path(name).resolve() for name in sys.argv[1:]] or PAGES:
        each.write_text(rewritten(each), encoding="utf-8")
