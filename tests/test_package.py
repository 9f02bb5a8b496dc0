"""The package as a whole: versions agree, imports go one way, importing it is cheap, public names exist."""

import ast
import importlib.metadata
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import networkx
import pytest

import robust

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "robust"
HEAVY = ("pysmt", "z3", "cvc5", "sympy", "matplotlib", "numpy")
DRAWING = ("matplotlib", "networkx")


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
        installed = importlib.metadata.version("robust-plans")
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
    assert names - {"robust-plans"} <= locked  # extras may name other extras


# -- imports go one way ----------------------------------------------------------------------------------------------


def layers() -> dict[str, int]:
    """The order of folders that ARCHITECTURE.md states, as a rank for each."""
    section = text("ARCHITECTURE.md").split("who may import whom")[1].split("\n## ")[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `robust/")]
    return {
        name.removesuffix(".py").rstrip("/"): rank
        for rank, row in enumerate(rows)
        for name in re.findall(r"`robust/([a-z_]+(?:\.py|/))`", row)
    }


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def imported(path: Path, package: str = "robust") -> Iterator[tuple[str, str]]:
    """Modules of a package (of any, if empty) that a file imports but for type checkers, with each name taken."""
    checked = ast.parse(path.read_text(encoding="utf-8"))
    only_types = [
        node for node in ast.walk(checked) if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
    ]
    skipped = {id(inner) for node in only_types for statement in node.body for inner in ast.walk(statement)}
    for node in ast.walk(checked):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if package in {alias.name.split(".")[0], ""})
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import; expected an absolute one"
            for alias in node.names if package in {(node.module or "").split(".")[0], ""} else ():
                inner = f"{node.module}.{alias.name}"
                home = robust._HOME.get(alias.name) if node.module == "robust" else None
                yield (inner, "") if inner in MODULES else (home or node.module or "", alias.name)


def test_a_module_imports_only_from_its_own_layer_and_those_above():
    rank = layers()
    wrong = []
    for name, path in MODULES.items():
        own = name.split(".")[1] if name != "robust" else None
        assert own is None or own in rank, f"ARCHITECTURE.md does not say what {name} may import"
        for module, _ in imported(path):
            layer = module.split(".")[1] if module != "robust" else None
            if own is not None and layer is not None and rank[layer] > rank[own]:
                wrong.append(f"{name} imports {module}")
    assert not wrong


def test_no_modules_import_each_other_in_a_circle():
    """Also not from inside functions: what implements imports its interface, and a registry imports both."""
    graph = networkx.DiGraph(
        (name, module)
        for name, path in MODULES.items()
        for module, _ in imported(path)
        if module in MODULES and module not in {name, "robust"}
    )
    assert [sorted(circle) for circle in networkx.strongly_connected_components(graph) if len(circle) > 1] == []


def mentioned(path: Path) -> Iterator[str]:
    """Modules that a file imports at all, for types only as well, or names in a text."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (name if name in MODULES else node.module or "" for name in inner)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            name = re.match(r"robust(\.\w+)*", node.value)
            parts = name[0].split(".") if name is not None else []
            modules = (".".join(parts[:end]) for end in range(len(parts), 1, -1))
            yield from islice((module for module in modules if module in MODULES), 1)


def test_no_circle_goes_through_types_or_names_of_modules_in_texts_either():
    graph = networkx.DiGraph(
        (name, module)
        for name, path in MODULES.items()
        for module in mentioned(path)
        if module in MODULES and module not in {name, "robust"}
    )
    assert [sorted(circle) for circle in networkx.strongly_connected_components(graph) if len(circle) > 1] == []


def test_class_names_are_unique():
    """A name that is searched for is found once."""
    homes: dict[str, list[str]] = {}
    for name, path in MODULES.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(name)
    assert {name: modules for name, modules in homes.items() if len(modules) > 1} == {}


def test_every_layer_of_the_architecture_exists_and_says_what_lives_there():
    for name in layers():
        path = PACKAGE / name / "__init__.py" if (PACKAGE / name).is_dir() else PACKAGE / f"{name}.py"
        assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), path


def test_the_solver_layer_takes_only_arithmetic_from_the_plan_layer():
    taken = {
        taken
        for path in (PACKAGE / "smt").glob("*.py")
        for taken in imported(path)
        if taken[0].startswith("robust.plan")
    }
    assert taken <= {("robust.plan.polynomial", "Polynomial"), ("robust.plan.model", "Relation")}


def test_the_simulator_shares_no_code_with_the_relational_encoding():
    simulator = {"robust.plan.simulate", "robust.plan.timeline"}
    for name in simulator:
        assert not [module for module, _ in imported(MODULES[name]) if "encode" in module]
    for name, path in MODULES.items():
        if name.startswith("robust.encode") and "positions" not in name:
            assert not simulator & {module for module, _ in imported(path)}, name


def test_only_one_folder_draws():
    """For all others, what a figure is called is a type at most."""
    for name, path in MODULES.items():
        loaded = {module.split(".")[0] for module, _ in imported(path, "")}
        assert name.startswith("robust.draw.") or not loaded & set(DRAWING), name


# -- importing is cheap ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "heavy"),
    [("plan", HEAVY), ("smt", HEAVY), ("irr", HEAVY), ("show.presenting", DRAWING), ("draw.interactive", DRAWING)],
)
def test_importing_loads_nothing_heavy(name, heavy):
    code = f"import json, sys, robust.{name}; print(json.dumps(sorted(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not set(heavy) & set(json.loads(run.stdout))


# -- public names ----------------------------------------------------------------------------------------------------


def test_public_names_are_sorted_and_each_has_a_home():
    assert robust.__all__ == sorted({*robust._HOME, "__version__", "pike", "stnu"})
    assert None not in [getattr(robust, name) for name in robust.__all__]
    assert (PACKAGE / "py.typed").is_file()


def test_a_name_that_does_not_exist_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'envelop'"):
        robust.envelop  # noqa: B018 - the access is the test


def test_nothing_is_imported_before_signals_are_blocked():
    """From then on Ctrl-C shows no traceback; what the interpreter loads by itself is not ours."""
    code = "import sys; before = set(sys.modules); import robust.cli; print(*sorted(set(sys.modules) - before))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"robust", "robust.cli"} <= {*ran.stdout.split()}
    assert not {"typing", "dataclasses", "re", "rich", "msgspec", "robust.errors"} & {*ran.stdout.split()}
