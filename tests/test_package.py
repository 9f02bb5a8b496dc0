"""The package as a whole: versions agree, imports go one way, importing it is cheap, public names exist."""

import ast
import importlib.metadata
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import robust

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "robust"
HEAVY = ("pysmt", "z3", "cvc5", "sympy", "lark", "matplotlib", "numpy", "joblib")


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


# -- versions --------------------------------------------------------------------------------------------------------


def test_citation_and_changelog_have_the_version_of_the_package():
    cited = re.search(r"^version: (\S+)$", text("CITATION.cff"), re.MULTILINE)
    logged = re.search(r"^## \[(\d[^\]]*)\]", text("CHANGELOG.md"), re.MULTILINE)
    assert cited is not None
    assert logged is not None
    assert (cited[1], logged[1]) == (robust.__version__, robust.__version__)


def test_installed_metadata_have_the_version_of_the_package():
    try:
        installed = importlib.metadata.version("robust")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the package is on the path, but not installed")
    assert installed == robust.__version__


def test_minimum_python_is_said_the_same_everywhere():
    project = text("pyproject.toml")
    assert 'requires-python = ">=3.11"' in project
    assert 'target-version = "py311"' in project
    assert 'python_version = "3.11"' in project
    assert "Python 3.11" in text("README.md")


def test_every_dependency_is_locked():
    locked = {name.lower() for name in re.findall(r"^([A-Za-z0-9_.-]+)==", text("constraints.txt"), re.MULTILINE)}
    project = text("pyproject.toml")
    wanted = re.search(r"^dependencies = \[(.*?)^\]", project, re.MULTILINE | re.DOTALL)
    extras = re.search(r"^dev = \[(.*?)^\]", project, re.MULTILINE | re.DOTALL)
    assert wanted is not None
    assert extras is not None
    names = {name.lower() for name in re.findall(r'"([A-Za-z0-9_.-]+)', wanted[1] + extras[1])}
    assert names - {"robust"} <= locked  # extras may name other extras


# -- imports go one way ----------------------------------------------------------------------------------------------


def layers() -> dict[str, int]:
    """The order of folders that ARCHITECTURE.md states, as a rank for each."""
    section = text("ARCHITECTURE.md").split("## Who may import whom")[1].split("\n## ")[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `robust/")]
    return {
        name.removesuffix(".py").rstrip("/"): rank
        for rank, row in enumerate(rows)
        for name in re.findall(r"`robust/([a-z_]+(?:\.py|/))`", row)
    }


def modules() -> list[Path]:
    return [path for path in sorted(PACKAGE.rglob("*.py")) if path != PACKAGE / "__init__.py"]


def layer_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(path: Path) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Modules of the package that a file imports, anywhere in it, with the names taken from each."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, ()) for alias in node.names if alias.name.split(".")[0] == "robust")
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import; expected an absolute one"
            names = tuple(alias.name for alias in node.names)
            if node.module == "robust":
                yield from ((robust._HOME.get(name, f"robust.{name}"), (name,)) for name in names)
            elif node.module and node.module.startswith("robust."):
                yield node.module, names


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_imports_only_from_its_own_layer_and_those_above(path):
    rank = layers()
    own = layer_of(path)
    assert own in rank, f"ARCHITECTURE.md does not say what robust/{own} may import"
    for module, _ in imported(path):
        parts = module.split(".")
        if len(parts) == 1 or parts[1] == "__version__":
            continue
        assert parts[1] in rank, f"ARCHITECTURE.md does not say where {module} belongs"
        assert rank[parts[1]] <= rank[own], f"{path} imports {module}"


def test_every_layer_of_the_architecture_exists():
    for name in layers():
        assert (PACKAGE / name).is_dir() or (PACKAGE / f"{name}.py").is_file(), name


def test_the_solver_layer_takes_only_arithmetic_from_the_plan_layer():
    taken = {
        (module, name)
        for path in (PACKAGE / "smt").glob("*.py")
        for module, names in imported(path)
        if module.startswith("robust.plan")
        for name in names
    }
    assert taken <= {("robust.plan.polynomial", "Polynomial"), ("robust.plan.model", "Relation")}


def test_only_the_main_module_imports_the_command_line():
    importers = {
        path.name for path in PACKAGE.rglob("*.py") for module, _ in imported(path) if module.startswith("robust.cli")
    }
    assert importers <= {"__main__.py"}


def test_the_simulator_shares_no_code_with_the_encoding():
    for name in ("simulate", "timeline", "interference"):
        assert not [module for module, _ in imported(PACKAGE / "plan" / f"{name}.py") if "encode" in module]
    for path in (PACKAGE / "encode").glob("*.py"):
        for module, _ in imported(path):
            assert module.split(".")[-1] not in {"simulate", "timeline", "interference"}, path


# -- importing is cheap ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("statement", ["import robust", "import robust.plan", "import robust.smt", "import robust.irr"])
def test_importing_loads_nothing_heavy(statement):
    code = f"import json, sys; {statement}; print(json.dumps(sorted(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not set(HEAVY) & set(json.loads(run.stdout))


def test_the_help_of_the_command_line_loads_nothing_heavy():
    code = (
        "import contextlib, io, json, sys\n"
        "from robust.cli import main\n"
        "sys.argv = ['robust', '--help']\n"
        "with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n"
        "    main()\n"
        "print(json.dumps(sorted(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not set(HEAVY) & set(json.loads(run.stdout))


# -- public names ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", robust.__all__)
def test_public_names_exist(name):
    assert getattr(robust, name) is not None


def test_public_names_are_sorted_and_each_has_a_home():
    assert robust.__all__ == sorted(robust.__all__)
    assert {*robust._HOME, "__version__"} == set(robust.__all__)


def test_a_name_that_does_not_exist_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'envelop'"):
        robust.envelop  # noqa: B018 - the access is the test


def test_the_package_is_marked_as_typed():
    assert (PACKAGE / "py.typed").is_file()
