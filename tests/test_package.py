"""The package: versions agree, imports go one way and are cheap, names exist, answers have no truth value."""

import ast
import importlib.metadata
import inspect
import json
import re
import sys
from enum import Enum
from functools import cache, cached_property
from importlib import import_module
from itertools import islice
from pathlib import Path

import networkx
import pytest

import robust
from robust import pike, stnu, unified_planning
from robust.presented import NoTruthValue, VerdictEnum
from tests.cli.running import REPOSITORY as ROOT
from tests.cli.running import example, ran

PACKAGE = ROOT / "robust"
HEAVY = ("pysmt", "z3", "cvc5", "sympy", "matplotlib", "numpy")
DRAWING = ("matplotlib", "networkx")


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


def section(name, pattern):
    """The first group of a pattern that a file matches."""
    match = re.search(pattern, text(name), re.MULTILINE | re.DOTALL)
    assert match is not None, (name, pattern)
    return match[1]


def test_versions_are_said_the_same_everywhere_and_every_dependency_is_locked():
    assert section("CITATION.cff", r"^version: (\S+)$") == robust.__version__
    assert section("CHANGELOG.md", r"^## \[(\d[^\]]*)\]") == robust.__version__
    assert importlib.metadata.version("robust-plans") == robust.__version__
    for line in ('requires-python = ">=3.11"', 'target-version = "py311"', 'python_version = "3.11"'):
        assert line in text("pyproject.toml")
    assert "Python 3.11" in text("README.md")
    locked = {name.lower() for name in re.findall(r"^([A-Za-z0-9_.-]+)==", text("constraints.txt"), re.MULTILINE)}
    wanted = "".join(section("pyproject.toml", rf"^{name} = \[(.*?)^\]") for name in ("dependencies", "dev"))
    names = {name.lower() for name in re.findall(r'"([A-Za-z0-9_.-]+)', wanted)}
    assert names - {"robust-plans"} <= locked  # extras may name other extras


@cache
def layers():
    """The order of folders that ARCHITECTURE.md states, as a rank for each."""
    rows = re.findall(r"^\| (`robust/.*?)\|", section("ARCHITECTURE.md", "who may import whom(.*?)\n## "), re.MULTILINE)
    return {
        name.removesuffix(".py").rstrip("/"): rank
        for rank, row in enumerate(rows)
        for name in re.findall(r"`robust/([a-z_]+(?:\.py|/))`", row)
    }


def module_name(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


@cache
def tree(name):
    return ast.parse(MODULES[name].read_text(encoding="utf-8"))


@cache
def imported(name, package="robust"):
    """Modules of a package (of any, if empty) that one imports but for type checkers, with each name taken."""

    def found():
        nodes = list(ast.walk(tree(name)))
        only_types = [node for node in nodes if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)]
        skipped = {id(inner) for node in only_types for statement in node.body for inner in ast.walk(statement)}
        for node in nodes:
            if id(node) in skipped:
                continue
            if isinstance(node, ast.Import):
                yield from ((alias.name, "") for alias in node.names if package in {alias.name.split(".")[0], ""})
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{name}:{node.lineno}: relative import; expected an absolute one"
                for alias in node.names if package in {(node.module or "").split(".")[0], ""} else ():
                    inner = f"{node.module}.{alias.name}"
                    home = robust._HOME.get(alias.name) if node.module == "robust" else None
                    yield (inner, "") if inner in MODULES else (home or node.module or "", alias.name)

    return tuple(found())


def mentioned(name):
    """Modules that one imports at all, for types only as well, or names in a text."""
    for node in ast.walk(tree(name)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (name if name in MODULES else node.module or "" for name in inner)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            match = re.match(r"robust(\.\w+)*", node.value)
            parts = match[0].split(".") if match is not None else []
            modules = (".".join(parts[:end]) for end in range(len(parts), 1, -1))
            yield from islice((module for module in modules if module in MODULES), 1)


def test_a_module_imports_only_from_its_own_layer_and_those_above():
    rank, wrong = layers(), []
    for name in MODULES.keys() - {"robust"}:
        own = name.split(".")[1]
        assert own in rank, f"ARCHITECTURE.md does not say what {name} may import"
        for module, _ in imported(name):
            if module != "robust" and rank[module.split(".")[1]] > rank[own]:
                wrong.append(f"{name} imports {module}")
    assert not wrong


@pytest.mark.parametrize("modules_of", [lambda name: [module for module, _ in imported(name)], mentioned])
def test_no_modules_import_each_other_in_a_circle(modules_of):
    """Neither from inside functions (what implements imports its interface) nor by types or by names in texts."""
    graph = networkx.DiGraph(
        (name, module)
        for name in MODULES
        for module in modules_of(name)
        if module in MODULES and module not in {name, "robust"}
    )
    assert [sorted(circle) for circle in networkx.strongly_connected_components(graph) if len(circle) > 1] == []


def test_class_names_are_unique():
    """A name that is searched for is found once."""
    homes = {}
    for name in MODULES:
        for node in ast.walk(tree(name)):
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(name)
    assert {name: modules for name, modules in homes.items() if len(modules) > 1} == {}


def test_every_layer_of_the_architecture_exists_and_says_what_lives_there():
    for name in layers():
        assert ast.get_docstring(tree(f"robust.{name}")), name


def test_the_simulator_shares_no_code_with_the_encoding_and_solvers_take_only_arithmetic_from_plans():
    simulator = {"robust.plan.simulate", "robust.plan.timeline"}
    for name in simulator:
        assert not [module for module, _ in imported(name) if "encode" in module]
    for name in MODULES:
        if name.startswith("robust.encode") and name not in {"robust.encode.positions", "robust.encode.trajectories"}:
            assert not simulator & {module for module, _ in imported(name)}, name
    solving = [name for name in MODULES if name.startswith("robust.smt")]
    taken = {name for module in solving for name in imported(module) if name[0].startswith("robust.plan")}
    assert taken <= {("robust.plan.polynomial", "Polynomial"), ("robust.plan.model", "Relation")}


def test_only_one_folder_draws():
    """For all others, what a figure is called is a type at most."""
    for name in MODULES:
        loaded = {module.split(".")[0] for module, _ in imported(name, "")}
        assert name.startswith("robust.draw.") or not loaded & set(DRAWING), name


@pytest.mark.parametrize(
    ("modules", "heavy"), [("robust.plan, robust.smt, robust.irr", HEAVY), ("robust.show.presenting", DRAWING),
                           ("robust.draw.interactive", DRAWING)],
)  # fmt: skip
def test_importing_loads_nothing_heavy(modules, heavy):
    ended = ran(sys.executable, "-c", f"import json, sys, {modules}; print(json.dumps(sorted(sys.modules)))")
    assert not set(heavy) & set(json.loads(ended.out))


def test_nothing_is_imported_before_signals_are_blocked():
    """From then on Ctrl-C shows no traceback; what the interpreter loads by itself is not ours."""
    code = "import sys; before = set(sys.modules); import robust.cli; print(*sorted(set(sys.modules) - before))"
    loaded = {*ran(sys.executable, "-c", code).out.split()}
    assert {"robust", "robust.cli"} <= loaded
    assert not {"typing", "dataclasses", "re", "rich", "msgspec", "robust.errors"} & loaded


def test_public_names_are_sorted_and_each_has_a_home():
    assert robust.__all__ == sorted({*robust._HOME, "__version__", "pike", "stnu"})
    assert None not in [getattr(robust, name) for name in robust.__all__]
    assert (PACKAGE / "py.typed").is_file()
    with pytest.raises(AttributeError, match="no attribute 'envelop'"):
        robust.envelop  # noqa: B018 - the access is the test


@pytest.mark.parametrize("module", [robust, pike, stnu], ids=lambda module: module.__name__)
def test_public_names_exist_and_are_documented(module):
    for name in module.__all__:
        value = getattr(module, name)
        if isinstance(value, type) or callable(value):
            assert (value.__doc__ or "").strip(), name
            assert not (value.__doc__ or "").startswith(f"{name}("), f"{name} has no words of its own"


@pytest.mark.parametrize("module", [robust, pike, stnu], ids=lambda module: module.__name__)
def test_what_public_classes_offer_is_documented(module):
    for kind in filter(inspect.isclass, (getattr(module, name) for name in module.__all__)):
        own = [base for base in kind.__mro__ if base.__module__.startswith("robust.")]
        for name, value in ((name, value) for base in own for name, value in vars(base).items() if name[0] != "_"):
            if isinstance(value, property | cached_property | staticmethod | classmethod) or inspect.isfunction(value):
                assert (inspect.getdoc(value) or inspect.getdoc(getattr(kind, name)) or "").strip(), (kind, name)


TIMES = "at begins delay ends expected lag latest now schedule since slack time"
"""What attributes of public classes are called that are times."""


@pytest.mark.parametrize("module", [robust, pike, stnu], ids=lambda module: module.__name__)
def test_public_classes_say_in_which_unit_their_times_are(module):
    for kind in filter(inspect.isclass, (getattr(module, name) for name in module.__all__)):
        times = [name for name in TIMES.split() if "Fraction" in str(vars(kind).get("__annotations__", {}).get(name))]
        assert not times or re.search(r"\bunit\b|time of the", inspect.getdoc(kind)), (kind, times)


NEVER_WRONG = {"drive", "knowledge_bases", "reasoner_names", "refutes", "run_in_world"}
"""Public functions that raise no errors of their own."""


@pytest.mark.parametrize("module", [robust, pike, stnu, unified_planning], ids=lambda module: module.__name__)
def test_public_functions_say_what_they_take_return_and_raise(module):
    for function in filter(inspect.isfunction, (getattr(module, name) for name in module.__all__)):
        words, signature = inspect.getdoc(function), inspect.signature(function)
        parts = {
            "Args": bool(signature.parameters),
            "Returns": signature.return_annotation not in {None, "None"},
            "Raises": function.__name__ not in NEVER_WRONG,
        }
        sections = re.findall(r"^(Args|Returns|Raises):$", words, re.MULTILINE)
        assert sections == [part for part, wanted in parts.items() if wanted], function.__name__
        lacking = [name for name in signature.parameters if not re.search(rf"^    {name}: ", words, re.MULTILINE)]
        assert lacking == [], function.__name__


def test_scripts_of_users_are_checked_by_types(tmp_path):
    """mypy, strictly, reads a script that uses all of the package, and finds what is wrong in another."""
    script, wrong = Path(__file__).with_name("typed_script.py"), tmp_path / "wrong.py"
    lines = [
        'import robust\n\nplan = robust.load_plan("d", "p", "s")\nrobust.check(plan, encodin="positions")',
        'robust.envelope(plan, beta=[1]).box.area\nrobust.risk(plan, {"a": "normal:3:1"}, withing=1)',
        'robust.batch("compare", "suite", job=2, regio="project")\n',
    ]
    wrong.write_text("\n".join(lines), encoding="utf-8")
    variables = {"MYPYPATH": str(ROOT), "PATH": "/usr/bin:/bin"}
    ended = ran(sys.executable, "-m", "mypy", script, wrong, cwd=ROOT, env=variables, timeout=300)
    assert (ended.err, script.name in ended.out) == ("", False), ended.out
    for name in ("encodin", "withing", "job", "regio"):
        assert f'Unexpected keyword argument "{name}"' in ended.out
    assert 'Argument "beta"' in ended.out
    assert 'has no attribute "area"' in ended.out
    functions = [name for name in robust.__all__ if name.islower() and callable(getattr(robust, name))]
    used = script.read_text(encoding="utf-8")
    elsewhere = {"from_unified_planning", "to_unified_planning"}  # what they take is not typed
    assert [name for name in functions if f"robust.{name}(" not in used and name not in elsewhere] == []
    for module, names in (("pike", ("check", "compile", "run", "region", "envelope")), ("stnu", ("check", "repair"))):
        assert [name for name in names if f"{module}.{name}(" not in used] == []


ANSWERS = "agree answer ending exit_code is_controllable obstacle outcome status valid verdict"
"""What attributes are called that say what came of a question."""
NO_ANSWERS = """About AssignmentKind Below Case Cause Changeable Comparator Control Guarantee Human Kind Means Mode
MessageKind MomentSide NodeKind Operator Pace Phase Relation Role Sense Side Stage Subject Target TeamParameterKind
Temporal TimePointKind Timing Update Way"""
"""Enumerations that answer no question."""


@cache
def classes(kind):
    """All of that kind that the package declares, but for the checker, which imports nothing of it."""
    wanted = [name for name in MODULES if "__main__" not in name and not name.startswith("robust.certify.checker")]
    found = {value for name in wanted for _, value in inspect.getmembers(import_module(name), inspect.isclass)}
    return sorted((each for each in found if each.__module__.startswith("robust.") and issubclass(each, kind)), key=str)


@pytest.mark.parametrize("result", classes(NoTruthValue), ids=lambda result: result.__qualname__)
def test_results_have_no_truth_value_and_name_what_has(result):
    if inspect.isabstract(result) or "_ask" not in dir(result):  # what results inherit from
        return
    assert hasattr(result, result._ask) or result._ask in result.__annotations__
    with pytest.raises(TypeError, match=rf"^{result.__name__} has no truth value: ask \.{result._ask}, or "):
        bool(object.__new__(result))


@pytest.mark.parametrize("kind", classes(Enum), ids=lambda kind: kind.__qualname__)
def test_answers_have_no_truth_value(kind):
    assert issubclass(kind, VerdictEnum) is (kind.__name__ not in NO_ANSWERS.split())
    for member in kind if issubclass(kind, VerdictEnum) else ():
        with pytest.raises(TypeError, match=rf"^{member} has no truth value: ask whether it `is {kind.__name__}\."):
            bool(member)


def test_whatever_says_what_came_of_a_question_is_a_result():
    values = [getattr(package, name) for package in (robust, pike, stnu) for name in package.__all__]
    public = {value for value in values if isinstance(value, type)}
    telling = {kind for kind in public if {*ANSWERS.split()} & {*vars(kind), *vars(kind).get("__annotations__", ())}}
    assert {kind for kind in telling if not issubclass(kind, NoTruthValue | Exception)} == set()
    assert len(telling) > 15


def test_what_is_no_answer_has_a_truth_value():
    checked = robust.check(example())
    assert checked.box
    assert list(filter(None, checked.obligations)) == list(checked.obligations)
    with pytest.raises(TypeError, match=r"^CheckResult has no truth value: ask \.answer, or whether it `is None`$"):
        assert checked
