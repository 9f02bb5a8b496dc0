"""How strong the tests of the checker are: small changes to its text, each of which has to be noticed.

    python -m tests.certify.mutants [MODULE ...] [--only PATTERN] [--every N [--first M]] [--seconds S]

Every comparison, operator, constant, operand, argument, condition and statement of `proofs/checker/` is changed or left
out, one at a time. The changed checker runs in this process against the bank of `tests.certify.bank`: honest
certificates, forged ones, false claims, and plans whose meaning the simulator and the oracle know. It is noticed if
something false is accepted, something honest is refused, or it does not end. Changes that nothing can or should notice
are listed in `mutants_accepted.txt`: the function, the line that the change makes, and why. Exit code 1 if another one
is left.
"""

from __future__ import annotations

import argparse
import ast
import copy
import gc
import multiprocessing
import re
import resource
import signal
import sys
import time
import types
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from robust.certify.verify import FOLDER
from tests.certify.tools import Checker

ACCEPTED = Path(__file__).with_name("mutants_accepted.txt")
MODULES = ("reader", "formulas", "proofs", "claims", "choices", "__main__")
ASKED = {
    "reader": ("texts", "reading", "wrong text", "forged plan", "oracle", "honest"),
    "formulas": ("reading", "free", "forged", "oracle", "honest"),
    "proofs": ("small", "forged", "leaves of plan", "leaves of network", "honest two"),
    "claims": ("within", "small", "forged plan", "leaves of plan", "honest", "demanded"),
    "choices": ("oracle", "executions", "wrong network", "knowledge", "leaves of ex", "leaves of kn", "kitchen"),
    "__main__": ("main",),
}
"""What is asked of a change of a module: beginnings of the names of probes."""
TEXTS = {name: (FOLDER / f"{name}.py").read_text(encoding="utf-8") for name in MODULES}
SECONDS = 20
"""Of processor time, after which a changed checker counts as noticed: it does not end."""
MORE_MEMORY = 3 << 30

Operators = dict[type[ast.AST], tuple[type[ast.AST], ...]]
COMPARISONS: Operators = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}  # fmt: skip
BINARY: Operators = {
    ast.Add: (ast.Sub,), ast.Sub: (ast.Add,), ast.Mult: (ast.Add,), ast.Div: (ast.Mult,), ast.FloorDiv: (ast.Mult,),
    ast.BitOr: (ast.BitAnd,), ast.BitAnd: (ast.BitOr,),
}  # fmt: skip
TWINS = {"all": "any", "any": "all", "min": "max", "max": "min", "sorted": "list", "abs": "int"}


class Mutant(NamedTuple):
    """A change: where, the line before and after, and the syntax tree of the whole module that has it."""

    module: str
    function: str
    before: str
    after: str
    tree: ast.Module

    @property
    def key(self) -> tuple[str, str]:
        return f"{self.module}.{self.function}", self.after


# -- changes -----------------------------------------------------------------------------------------------------------


def with_field(node: Any, name: str, value: object) -> Any:
    changed = copy.copy(node)
    setattr(changed, name, value)
    return changed


def instead(node: ast.expr) -> Iterator[ast.expr]:  # noqa: PLR0912 - one branch for each kind of expression
    """What an expression is changed to; parts that stay are shared."""
    match node:
        case ast.Compare(ops=operators, comparators=others):
            for place, operator in enumerate(operators):
                for new in COMPARISONS[type(operator)]:
                    yield with_field(node, "ops", [*operators[:place], new(), *operators[place + 1 :]])
            if len(operators) > 1:
                yield ast.Compare(node.left, operators[:-1], others[:-1])
                yield ast.Compare(others[0], operators[1:], others[1:])
        case ast.BoolOp(op=operator, values=values):
            yield with_field(node, "op", ast.Or() if isinstance(operator, ast.And) else ast.And())
            for place in range(len(values)):
                rest = values[:place] + values[place + 1 :]
                yield rest[0] if len(rest) == 1 else with_field(node, "values", rest)
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield operand
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in BINARY:
            for new in BINARY[type(operator)]:
                yield with_field(node, "op", new())
            yield left
            yield right
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
            yield ast.Constant(value - 1)
        case ast.Constant(value=str(value)):
            yield ast.Constant(value + "~")
        case ast.IfExp(body=body, orelse=other):
            yield body
            yield other
        case ast.Call(func=called, args=arguments, keywords=words):
            pairs = 0 if isinstance(called, ast.Name) and called.id in ("need", "demand") else len(arguments) - 1
            for place in range(pairs):
                if ast.dump(arguments[place]) == ast.dump(arguments[place + 1]):
                    continue
                swapped = [*arguments[:place], arguments[place + 1], arguments[place], *arguments[place + 2 :]]
                yield with_field(node, "args", swapped)
            for word in words:
                yield with_field(node, "keywords", [each for each in words if each is not word])
            if isinstance(called, ast.Name) and called.id in TWINS:
                yield with_field(node, "func", ast.Name(TWINS[called.id], ast.Load()))
        case ast.List(elts=parts) | ast.Set(elts=parts) | ast.Tuple(elts=parts) if isinstance(node, ast.expr):
            if len(parts) > 1 or isinstance(node, ast.List):
                for place in range(len(parts)):
                    yield with_field(node, "elts", parts[:place] + parts[place + 1 :])
        case ast.Dict(keys=keys, values=values):
            for place in range(len(keys)):
                yield ast.Dict(keys[:place] + keys[place + 1 :], values[:place] + values[place + 1 :])
        case ast.ListComp() | ast.SetComp() | ast.DictComp() | ast.GeneratorExp():
            for place, clause in enumerate(node.generators):
                for condition in clause.ifs:
                    less = with_field(clause, "ifs", [each for each in clause.ifs if each is not condition])
                    yield with_field(
                        node, "generators", [*node.generators[:place], less, *node.generators[place + 1 :]]
                    )


def instead_of_statement(node: ast.stmt) -> Iterator[list[ast.stmt]]:
    match node:
        case ast.Expr(value=ast.Constant()) | ast.Pass() | ast.Import() | ast.ImportFrom():
            return
        case ast.FunctionDef() | ast.ClassDef():
            return
        case ast.If():
            yield [with_field(node, "test", ast.Constant(True))]
            yield [with_field(node, "test", ast.Constant(False))]
        case ast.While():
            yield [with_field(node, "test", ast.Constant(False))]
        case ast.Try(body=body):
            yield body
        case ast.With(body=body):
            return
        case ast.AnnAssign(value=None):
            return
        case _:
            yield [ast.Pass()]


def is_message(parents: list[ast.AST], node: ast.AST) -> bool:
    """Texts for people (messages, documentation, labels of obligations), and types."""
    return any(_is_message(parent, inner) for parent, inner in pairwise([*parents, node]))


def _is_message(parent: ast.AST, inner: ast.AST) -> bool:  # noqa: PLR0911 - one return for each kind
    match parent:
        case ast.JoinedStr() | ast.Expr(value=ast.Constant()):
            return True
        case ast.Call(func=ast.Name(id="Rejected" | "Unsupported")):
            return True
        case ast.Call(func=ast.Name(id="need" | "demand"), args=[condition, *_]):
            return inner is not condition
        case ast.Call(func=ast.Attribute(attr="state"), args=[label, *_]):
            return inner is label
        case ast.keyword(arg="help" | "prog" | "description"):
            return True
        case ast.Call(func=ast.Subscript()):
            return inner is parent.func
        case ast.ClassDef():
            return inner in parent.decorator_list
        case ast.FunctionDef():
            return inner is parent.returns or inner in parent.decorator_list
        case ast.AnnAssign() | ast.arg():
            return inner is parent.annotation
    return False


def mutants(module: str) -> Iterator[Mutant]:
    """All changes of one module of the checker; the tree is changed in place, and changed back afterwards."""
    tree = ast.parse(TEXTS[module])
    yield from _changes(tree, [], module, "", tree)


def _changes(node: ast.AST, parents: list[ast.AST], module: str, function: str, tree: ast.Module) -> Iterator[Mutant]:
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        function = f"{function}.{node.name}".strip(".")
    for name, value in ast.iter_fields(node):
        for place, child in enumerate(value if isinstance(value, list) else [value]):
            if not isinstance(child, ast.AST) or is_message([*parents, node], child):
                continue
            if isinstance(child, ast.expr_context):
                continue
            variants: Iterator[Any] = iter(())
            if isinstance(child, ast.expr) and not isinstance(getattr(child, "ctx", None), (ast.Store, ast.Del)):
                variants = ([each] for each in instead(child))
            elif isinstance(child, ast.stmt):
                variants = instead_of_statement(child)
            for new in variants:
                yield from _changed(node, name, value, place, new, (module, function, tree), [*parents, node, child])
            yield from _changes(child, [*parents, node], module, function, tree)


def _changed(
    node: ast.AST,
    name: str,
    value: Any,
    place: int,
    new: list[Any],
    where: tuple[str, str, ast.Module],
    path: list[Any],
) -> Iterator[Mutant]:
    """The mutant, while the tree is changed."""
    module, function, tree = where
    statement = next((each for each in reversed(path[:-1]) if isinstance(each, ast.stmt)), path[-1])
    if isinstance(path[-1], ast.stmt):
        before, after = line_of(path[-1]), f"{line_of(new[0])}  # instead of: {line_of(path[-1])}"
        setattr(node, name, [*value[:place], *new, *value[place + 1 :]])
    else:
        before = line_of(statement)
        setattr(node, name, [*value[:place], *new, *value[place + 1 :]] if isinstance(value, list) else new[0])
        after = line_of(statement)
    try:
        yield Mutant(module, function, before, after, ast.fix_missing_locations(tree))
    finally:
        setattr(node, name, value)


def line_of(statement: ast.AST) -> str:
    """A statement, or the head of a longer one, on one line."""
    return ast.unparse(statement).splitlines()[0]


# -- runs --------------------------------------------------------------------------------------------------------------


class OutOfTime(BaseException):
    """The changed checker does not end."""


@contextmanager
def limit(seconds: float) -> Iterator[None]:
    def stop(*_: object) -> None:
        raise OutOfTime

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def load(changed: str | None = None, code: Any = None) -> Checker:
    """The checker, with other code for one of its modules."""
    package = "changed_checker"
    made = [types.ModuleType(package)]
    made[0].__path__ = []
    try:
        for name in ("", *MODULES):
            module = types.ModuleType(f"{package}.{name}") if name else made.pop()
            module.__package__ = package
            sys.modules[module.__name__] = module
            if name:
                made.append(module)
                module.__dict__["CODE"] = code if name == changed else CODE[name]
                exec(module.__dict__["CODE"], module.__dict__)  # noqa: S102 - this is the checker
    finally:
        for key in [key for key in sys.modules if key.partition(".")[0] == package]:
            del sys.modules[key]
    return Checker(*made)


CODE = {name: compile(text, f"{name}.py", "exec", dont_inherit=True) for name, text in TEXTS.items()}


@dataclass
class Probe:
    """Something that a checker has to get right; an exception that nobody expects is as wrong as a wrong answer."""

    name: str
    holds: Callable[[Checker], bool]


def noticed_by(mutant: Mutant, probes: list[Probe], seconds: float) -> str | None:
    """What notices a change; None if nothing does. Probes that noticed the last changes are asked first."""
    name = "at start"
    try:
        with limit(seconds):
            checker = load(mutant.module, compile(mutant.tree, mutant.module, "exec", dont_inherit=True))
            for place, probe in enumerate(probes):
                name = probe.name
                if not probe.holds(checker):
                    probes.insert(place // 4, probes.pop(place))
                    return name
    except OutOfTime:
        return "time"
    except (Exception, SystemExit) as error:
        return f"{name}: {type(error).__name__}"
    return None


def measure(arguments: tuple[str, int, int, str, float]) -> list[tuple[tuple[str, str], str, str | None, float]]:
    """Every so-manieth mutant of a module."""
    module, first, step, only, seconds = arguments
    size = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MORE_MEMORY, size[1]))
    sys.setrecursionlimit(3_000)
    from tests.certify.bank import probes  # noqa: PLC0415 - made once, before processes are forked

    bank, found = [Probe(*each) for each in probes(ASKED[module])], []
    gc.disable()
    for number, mutant in enumerate(mutants(module)):
        if number % step == first and re.search(only, f"{mutant.function} {mutant.after}"):
            start = time.monotonic()
            noticed = noticed_by(mutant, bank, seconds)
            found.append((mutant.key, mutant.before, noticed, time.monotonic() - start))
            if noticed is None:
                print(f"unnoticed: {mutant.function}: {mutant.after}", file=sys.stderr, flush=True)
            if number % 20 == first:
                gc.collect()
    return found


def accepted() -> dict[tuple[str, str], str]:
    """The changes that need no test, with reasons: function, new line and reason on lines of their own kind."""
    found, function, line = {}, "", ""
    for text in ACCEPTED.read_text(encoding="utf-8").splitlines() if ACCEPTED.exists() else ():
        if text.startswith("## "):
            function = text[3:].strip()
        elif text.startswith("- "):
            line = text[2:]
        elif text.startswith("  ") and line:
            found[function, line] = text.strip()
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description="Measure the strength of the checker's tests by mutants of its text.")
    parser.add_argument("modules", nargs="*", choices=[[], *MODULES], metavar="MODULE", help=", ".join(MODULES))
    parser.add_argument("--only", default="", metavar="PATTERN", help="only changes whose function and line match this")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only each N-th of them (1)")
    parser.add_argument(
        "--first", type=int, default=0, metavar="M", help="the first of these, from 0 (0): pieces of a run"
    )
    parser.add_argument("--seconds", type=float, default=SECONDS, metavar="S", help=f"for each ({SECONDS})")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="how many at a time (2)")
    parser.add_argument("--verbose", action="store_true", help="say of each change what noticed it")
    arguments = parser.parse_args()
    from tests.certify.bank import probes  # noqa: PLC0415 - takes some seconds

    fine, left, why = accepted(), 0, Counter[str]()
    used = set()
    for module in arguments.modules or MODULES:
        start = time.monotonic()
        wrong = [name for name, holds in probes(ASKED[module]) if not holds(load())]
        if wrong:
            sys.exit(f"the checker itself does not pass: {wrong}")
        step = 8 * arguments.every
        firsts = range(arguments.first, step, arguments.every)
        shares = [(module, first, step, arguments.only, arguments.seconds) for first in firsts]
        with multiprocessing.get_context("fork").Pool(arguments.processes) as pool:
            found = [each for share in pool.imap_unordered(measure, shares, chunksize=1) for each in share]
        missed = sorted({(key, before) for key, before, noticed, _ in found if noticed is None})
        used |= {key for key, _ in missed}
        open_ones = [(key, before) for key, before in missed if key not in fine]
        left += len(open_ones)
        why.update((noticed or "nothing").split(":")[0].split(" ")[0] for _, _, noticed, _ in found)
        if arguments.verbose:
            print("\n".join(f"{key} <- {noticed} {took:.2f}" for key, _, noticed, took in found))
        print(
            f"{module:10} {len(found):5} changes, {sum(noticed is not None for _, _, noticed, _ in found):5} noticed, "
            f"{len(missed) - len(open_ones):3} accepted, {len(open_ones):3} left, {time.monotonic() - start:5.0f} s",
            flush=True,
        )
        for (function, after), before in open_ones:
            print(f"    {function}\n        - {before}\n        + {after}", flush=True)
    print(", ".join(f"{count} by {name}" for name, count in why.most_common()))
    if not arguments.modules and not arguments.only and arguments.every == 1:
        for key in fine.keys() - used:
            print(f"no longer left: {key[0]}: {key[1]}")
    return 1 if left else 0


if __name__ == "__main__":
    sys.exit(main())
