"""How strong the tests of the checker are: small changes to its text, each of which has to be noticed.

    python -m tests.certify.mutants [MODULE ...] [--every N [--first M]]

Every comparison, operator, constant, operand, argument, condition and statement of `proofs/checker/` is changed or left
out, one at a time, and the changed checker runs in this process against the bank of `tests.certify.test_bank`. It is
noticed if something false is accepted, something honest is refused, or it does not end. Changes that nothing can or
should notice are in `mutants_accepted.txt`, with reasons. Exit code 1 if another one is left.
"""

from __future__ import annotations

import argparse
import ast
import copy
import multiprocessing
import re
import resource
import signal
import sys
import types
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, NamedTuple

from robust.certify import FOLDER
from tests.certify.tools import Checker, put

ACCEPTED = Path(__file__).with_name("mutants_accepted.txt")
MODULES = ("reader", "formulas", "proofs", "corners", "claims", "choices", "__main__")
ASKED = {
    "reader": ("texts", "reading", "forged plan", "oracle", "honest"),
    "formulas": ("reading", "free", "forged", "oracle", "honest"),
    "proofs": ("small", "forged", "leaves of plan", "leaves of network", "honest two"),
    "corners": ("forged", "honest"),
    "claims": ("within", "small", "forged plan", "leaves of plan", "honest", "main of_plans", "main of_boxes"),
    "choices": ("oracle", "executions", "wrong network", "knowledge", "leaves of ex", "leaves of kn",
                "main of_choices"),
    "__main__": ("main",),
}  # fmt: skip
"""What is asked of a change of a module: beginnings of the names of probes."""
TEXTS = {name: (FOLDER / f"{name}.py").read_text(encoding="utf-8") for name in MODULES}
CODE = {name: compile(text, f"{name}.py", "exec", dont_inherit=True) for name, text in TEXTS.items()}
SECONDS = 20
"""Of processor time, after which a changed checker counts as noticed: it does not end."""
MORE_MEMORY = 3 << 30

COMPARISONS: dict[Any, tuple[Any, ...]] = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}  # fmt: skip
BINARY: dict[Any, Any] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.BitOr: ast.BitAnd, ast.BitAnd: ast.BitOr,
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
    def key(self):
        return f"{self.module}.{self.function}", self.after

    def checker(self):
        """The changed checker; only while the generator of mutants stands at this one."""
        return load(self.module, compile(ast.fix_missing_locations(self.tree), self.module, "exec", dont_inherit=True))


def with_field(node, name, value):
    changed = copy.copy(node)
    setattr(changed, name, value)
    return changed


def shorter(values):
    """The values without one of them."""
    return (put(values, place) for place in range(len(values)))


def instead(node):  # noqa: PLR0912 - one branch for each kind of expression
    """What an expression is changed to; parts that stay are shared."""
    match node:
        case ast.Compare(ops=operators, comparators=others):
            for place, operator in enumerate(operators):
                for new in COMPARISONS[type(operator)]:
                    yield with_field(node, "ops", put(operators, place, new()))
            if len(operators) > 1:
                yield ast.Compare(node.left, operators[:-1], others[:-1])
                yield ast.Compare(others[0], operators[1:], others[1:])
        case ast.BoolOp(op=operator, values=values):
            yield with_field(node, "op", ast.Or() if isinstance(operator, ast.And) else ast.And())
            for rest in shorter(values):
                yield rest[0] if len(rest) == 1 else with_field(node, "values", rest)
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield operand
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in BINARY:
            yield from (with_field(node, "op", BINARY[type(operator)]()), left, right)
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield from (ast.Constant(value + 1), ast.Constant(value - 1))
        case ast.Constant(value=str(value)):
            yield ast.Constant(value + "~")
        case ast.IfExp(body=body, orelse=other):
            yield from (body, other)
        case ast.Call(func=called, args=arguments, keywords=words):
            name = called.id if isinstance(called, ast.Name) else ""
            for place, (first, second) in enumerate(pairwise(arguments)) if name not in ("need", "demand") else ():
                if ast.dump(first) != ast.dump(second):
                    yield with_field(node, "args", [*arguments[:place], second, first, *arguments[place + 2 :]])
            yield from (with_field(node, "keywords", rest) for rest in shorter(words))
            if name in TWINS:
                yield with_field(node, "func", ast.Name(TWINS[name], ast.Load()))
        case ast.List(elts=parts) | ast.Set(elts=parts) | ast.Tuple(elts=parts):
            if len(parts) > 1 or isinstance(node, ast.List):
                yield from (with_field(node, "elts", rest) for rest in shorter(parts))
        case ast.Dict(keys=keys, values=values):
            yield from map(ast.Dict, shorter(keys), shorter(values))
        case ast.ListComp() | ast.SetComp() | ast.DictComp() | ast.GeneratorExp():
            for place, clause in enumerate(node.generators):
                for rest in shorter(clause.ifs):
                    yield with_field(node, "generators", put(node.generators, place, with_field(clause, "ifs", rest)))


SILENT = (ast.Pass, ast.Import, ast.ImportFrom, ast.FunctionDef, ast.ClassDef, ast.With)


def instead_of_statement(node):
    match node:
        case ast.Expr(value=ast.Constant()) | ast.AnnAssign(value=None):
            return
        case ast.If():
            yield from ([with_field(node, "test", ast.Constant(value))] for value in (True, False))
        case ast.While():
            yield [with_field(node, "test", ast.Constant(False))]
        case ast.Try(body=body):
            yield body
        case _ if not isinstance(node, SILENT):
            yield [ast.Pass()]


def is_message(parent, inner):  # noqa: PLR0911 - one return for each kind
    """Texts for people (messages, documentation, labels of obligations), and types."""
    match parent:
        case ast.JoinedStr() | ast.Expr(value=ast.Constant()) | ast.Call(func=ast.Name(id="Rejected" | "Unsupported")):
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


def mutants(module):
    """All changes of one module of the checker; the tree is changed in place, and changed back afterwards."""
    tree = ast.parse(TEXTS[module])
    for function, before, after in _changes(tree, "", None):
        yield Mutant(module, function, before, after, tree)


def _changes(node, function, statement):
    """Function, line before and line after of each change below a node, while the tree is changed."""
    statement = node if isinstance(node, ast.stmt) else statement
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        function = f"{function}.{node.name}".strip(".")
    for name, value in ast.iter_fields(node):
        for place, child in enumerate(value if isinstance(value, list) else [value]):
            if not isinstance(child, ast.AST) or isinstance(child, ast.expr_context) or is_message(node, child):
                continue
            variants: Iterator[list[Any]] = iter(())
            if isinstance(child, ast.stmt):
                variants = instead_of_statement(child)
            elif isinstance(child, ast.expr) and not isinstance(getattr(child, "ctx", None), (ast.Store, ast.Del)):
                variants = ([new] for new in instead(child))
            for new in variants:
                changed = child if isinstance(child, ast.stmt) else statement or child
                before = line_of(changed)
                setattr(node, name, put(value, place, *new) if isinstance(value, list) else new[0])
                whole = changed is child
                after = f"{line_of(new[0])}  # instead of: {before}" if whole else line_of(changed)
                try:
                    yield function, before, after
                finally:
                    setattr(node, name, value)
            yield from _changes(child, function, statement)


def line_of(statement):
    """A statement, or the head of a longer one, on one line."""
    head = {"body": [ast.Pass()], "orelse": []}
    for name in head.keys() & {*statement._fields} if isinstance(statement, ast.stmt) else ():
        statement = with_field(statement, name, head[name])
    return ast.unparse(statement).splitlines()[0]


class OutOfTime(BaseException):
    """The changed checker does not end."""


@contextmanager
def limit(seconds):
    def stop(*_):
        raise OutOfTime

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def load(changed=None, code=None):
    """The checker, with other code for one of its modules."""
    package = types.ModuleType("changed_checker")
    package.__path__ = []
    loaded = {package.__name__: package}
    try:
        sys.modules.update(loaded)
        for name in MODULES:
            module = types.ModuleType(f"{package.__name__}.{name}")
            module.__package__ = package.__name__
            loaded[module.__name__] = sys.modules[module.__name__] = module
            module.__dict__["CODE"] = code if name == changed else CODE[name]
            exec(module.__dict__["CODE"], module.__dict__)  # noqa: S102 - this is the checker
    finally:
        for name in loaded:
            del sys.modules[name]
    return Checker(*list(loaded.values())[1:])


def noticed_by(mutant, probes, seconds):
    """What notices a change; None if nothing does. Probes that noticed the last changes are asked first.

    An exception that nobody expects is as wrong as a wrong answer.
    """
    name = "at start"
    try:
        with limit(seconds):
            checker = mutant.checker()
            for place, (name, holds) in enumerate(probes):
                if not holds(checker):
                    probes.insert(place // 4, probes.pop(place))
                    return name
    except OutOfTime:
        return "time"
    except (Exception, SystemExit) as error:
        return f"{name}: {type(error).__name__}"
    return None


def measure(module, first, step):
    """Keys and old lines of every so-manieth mutant of a module, and what noticed each."""
    size = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MORE_MEMORY, size[1]))
    sys.setrecursionlimit(3_000)
    from tests.certify.test_bank import probes  # noqa: PLC0415 - made once, before processes are forked

    bank = probes(ASKED[module])
    chosen = islice(mutants(module), first, None, step)
    return [(mutant.key, mutant.before, noticed_by(mutant, bank, SECONDS)) for mutant in chosen]


def accepted():
    """The changes that need no test, with reasons: function, new line and reason on lines of their own kind."""
    reasons, function = {}, ""
    for match in re.finditer(r"^## (.*)$|^- (.*)\n  (.*)$", ACCEPTED.read_text(encoding="utf-8"), re.MULTILINE):
        function = match[1] or function
        if match[2]:
            reasons[function, match[2]] = match[3].strip()
    return reasons


def main():
    parser = argparse.ArgumentParser(description="Measure the strength of the checker's tests by mutants of its text.")
    parser.add_argument("modules", nargs="*", choices=[[], *MODULES], metavar="MODULE", help=", ".join(MODULES))
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only each N-th of them (1)")
    parser.add_argument("--first", type=int, default=0, metavar="M", help="the first of these, from 0 (0)")
    arguments = parser.parse_args()
    from tests.certify.test_bank import probes  # noqa: PLC0415 - takes some seconds

    unlisted = 0
    for module in arguments.modules or MODULES:
        if wrong := [name for name, holds in probes(ASKED[module]) if not holds(load())]:
            sys.exit(f"the checker itself does not pass: {wrong}")
        step = 8 * arguments.every
        shares = [(module, first, step) for first in range(arguments.first, step, arguments.every)]
        with multiprocessing.get_context("fork").Pool(2) as pool:
            records = [record for share in pool.starmap(measure, shares, chunksize=1) for record in share]
        missed = {(key, before) for key, before, noticed in records if noticed is None}
        left = sorted((key, before) for key, before in missed if key not in accepted())
        print(
            f"{module:10} {len(records):5} changes, {len(missed) - len(left):3} accepted, {len(left):3} left",
            flush=True,
        )
        for (function, after), before in left:
            print(f"    {function}\n        - {before}\n        + {after}", flush=True)
        unlisted += len(left)
    return 1 if unlisted else 0


if __name__ == "__main__":
    sys.exit(main())
