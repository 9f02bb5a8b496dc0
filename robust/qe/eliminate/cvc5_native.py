"""Work that cannot be interrupted, in a forked copy of the process that can be ended at any moment."""

from __future__ import annotations

import os
import pickle
import signal
import struct
import traceback
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import Any, assert_never

from robust.errors import SolverError, UnsupportedError
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.eliminate.enumerate import polyhedra_of
from robust.qe.eliminate.interface import Conjunction, Eliminator, Query, require_reals, without
from robust.qe.nnf import FALSE, TRUE, Junction, Literal, Nnf, conjunction, disjunction, names_in, negation, postorder
from robust.smt.limits import Deadline, OutOfTimeError, has_input

HEADER = struct.Struct("!?Q")


def stream_from_copy(work: Callable[[], Iterable[Any]], deadline: Deadline) -> Iterator[Any]:
    """What `work` yields, computed in a copy of this process; leaving the iteration early ends the copy.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the work failed or the copy died.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _run(work, writer)
    os.close(writer)
    try:
        while True:
            failed, size = HEADER.unpack(_read(reader, HEADER.size, deadline))
            item = pickle.loads(_read(reader, size, deadline))  # noqa: S301 - written by our own copy
            if failed:
                raise SolverError(f"quantifier elimination failed: {item}")
            if item is None:
                return
            yield item
    finally:
        os.close(reader)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def _run(work: Callable[[], Iterable[Any]], writer: int) -> None:
    """Runs in the copy, which must never return into the caller's stack; None marks the end."""
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            for item in work():
                _write(writer, False, item)
            _write(writer, False, None)
        except Exception:  # whatever it is, the caller must hear of it
            _write(writer, True, traceback.format_exc(limit=-1).strip().splitlines()[-1])
    finally:
        os._exit(0)


def _write(writer: int, failed: bool, item: Any) -> None:
    content = pickle.dumps(item)
    pending = memoryview(HEADER.pack(failed, len(content)) + content)
    while pending:
        pending = pending[os.write(writer, pending) :]


def _read(reader: int, size: int, deadline: Deadline) -> bytes:
    content = bytearray()
    while len(content) < size:
        if not has_input(reader, deadline):
            raise OutOfTimeError
        chunk = os.read(reader, min(1 << 20, size - len(content)))
        if not chunk:
            raise SolverError("the process that eliminates quantifiers died; it may have run out of memory")
        content += chunk
    return bytes(content)


try:
    import cvc5
    from cvc5 import Kind
except ImportError as error:
    raise SolverError("cvc5 is not installed; expected the Python package cvc5") from error


class Cvc5Disjuncts(Eliminator):
    """`getQuantifierEliminationDisjunct`, until nothing is left."""

    name = "cvc5"

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        context, said = self.context, list(known)
        formula = without(query.formula, said)
        require_reals(formula, self.name)
        for result in stream_from_copy(lambda: self._work(formula, query.eliminated), deadline):
            for piece in polyhedra_of(result, context.session, context.reader, deadline, said):
                yield piece
                said.append(piece)

    def _work(self, formula: Nnf, eliminated: Iterable[str]) -> Iterator[Nnf]:
        native = _Native(formula)
        quantified = native.exists(formula, eliminated)
        while True:
            disjunct = native.solver.getQuantifierEliminationDisjunct(quantified)
            result = native.read(disjunct)
            if result is FALSE:
                return
            yield result
            if result is TRUE:
                return
            native.solver.assertFormula(native.manager.mkTerm(Kind.NOT, disjunct))


class Cvc5Whole(Cvc5Disjuncts):
    """`getQuantifierElimination`."""

    name = "cvc5-whole"

    def _work(self, formula: Nnf, eliminated: Iterable[str]) -> Iterator[Nnf]:
        native = _Native(formula)
        yield native.read(native.solver.getQuantifierElimination(native.exists(formula, eliminated)))


class _Native:
    """One solver of cvc5 with the symbols of a formula."""

    def __init__(self, formula: Nnf) -> None:
        self.manager = cvc5.TermManager()
        self.solver = cvc5.Solver(self.manager)
        self.solver.setLogic("LRA")
        self._real = self.manager.getRealSort()
        self._symbols = {name: self.manager.mkConst(self._real, name) for name in sorted(names_in(formula))}

    def exists(self, formula: Nnf, eliminated: Iterable[str]) -> Any:
        bound = {name: self.manager.mkVar(self._real, name) for name in sorted(eliminated)}
        body = self._write(formula, {**self._symbols, **bound})
        # Without a variable to eliminate, a dummy one keeps it a quantified formula.
        variables = list(bound.values()) or [self.manager.mkVar(self._real, "nothing")]
        return self.manager.mkTerm(Kind.EXISTS, self.manager.mkTerm(Kind.VARIABLE_LIST, *variables), body)

    def _write(self, root: Nnf, symbols: dict[str, Any]) -> Any:
        images: dict[Nnf, Any] = {}
        for node in postorder(root):
            match node:
                case LinearConstraint():
                    images[node] = self._constraint(node, symbols)
                case Literal():
                    raise UnsupportedError(f"found the Boolean symbol {node.name!r}, expected real symbols only")
                case Junction(conjunctive, operands):
                    images[node] = self._junction(conjunctive, [images[operand] for operand in operands])
                case _:
                    assert_never(node)
        return images[root]

    def _junction(self, conjunctive: bool, parts: list[Any]) -> Any:
        if not parts:
            return self.manager.mkBoolean(conjunctive)
        return parts[0] if len(parts) == 1 else self.manager.mkTerm(Kind.AND if conjunctive else Kind.OR, *parts)

    def _constraint(self, node: LinearConstraint, symbols: dict[str, Any]) -> Any:
        manager = self.manager
        parts = [manager.mkTerm(Kind.MULT, self._number(c), symbols[name]) for name, c in node.coefficients]
        form = parts[0] if len(parts) == 1 else manager.mkTerm(Kind.ADD, *parts)
        kind = {Sense.AT_MOST: Kind.LEQ, Sense.LESS: Kind.LT, Sense.EQUAL: Kind.EQUAL}[node.relation]
        return manager.mkTerm(kind, form, self._number(node.constant))

    def _number(self, value: Fraction) -> Any:
        return self.manager.mkReal(value.numerator, value.denominator)

    def read(self, root: Any) -> Nnf:
        """A quantifier-free term as a formula.

        Raises:
            UnsupportedError: if a quantifier or anything but linear arithmetic is left.
        """
        images: dict[Any, Nnf] = {}
        stack = [root]
        while stack:
            node = stack[-1]
            children = list(node) if node.getKind() in CONNECTIVES and _is_boolean(node) else []
            missing = [child for child in children if child not in images]
            if missing:
                stack += missing
                continue
            stack.pop()
            images[node] = _image(node, [images[child] for child in children])
        return images[root]


CONNECTIVES = (Kind.AND, Kind.OR, Kind.NOT, Kind.IMPLIES, Kind.EQUAL, Kind.ITE)
RELATIONS = {
    Kind.LEQ: (Sense.AT_MOST, 1),
    Kind.LT: (Sense.LESS, 1),
    Kind.GEQ: (Sense.AT_MOST, -1),
    Kind.GT: (Sense.LESS, -1),
    Kind.EQUAL: (Sense.EQUAL, 1),
    Kind.DISTINCT: (Sense.EQUAL, 1),
}


def _is_boolean(node: Any) -> bool:
    return bool(node[0].getSort().isBoolean())


def _image(node: Any, parts: list[Nnf]) -> Nnf:  # noqa: PLR0911 - one way out for each kind
    kind = node.getKind()
    if kind == Kind.CONST_BOOLEAN:
        return TRUE if node.getBooleanValue() else FALSE
    match kind:
        case Kind.AND:
            return conjunction(parts)
        case Kind.OR:
            return disjunction(parts)
        case Kind.NOT:
            return negation(parts[0])
        case Kind.IMPLIES:
            return disjunction((negation(parts[0]), parts[1]))
        case Kind.ITE:
            return disjunction((conjunction((parts[0], parts[1])), conjunction((negation(parts[0]), parts[2]))))
        case Kind.EQUAL if parts:
            both, neither = conjunction(parts), conjunction(negation(part) for part in parts)
            return disjunction((both, neither))
    if kind in RELATIONS:
        return _atom(node)
    raise UnsupportedError(f"cvc5 left {node} in its result; back ends 'project' and 'loos-weispfenning' do not")


def _atom(node: Any) -> Nnf:
    sense, sign = RELATIONS[node.getKind()]
    total: dict[str, Fraction] = {}
    constant = Fraction(0)
    for weight, side in ((sign, node[0]), (-sign, node[1])):
        for name, factor in _terms(side, Fraction(weight)):
            if name is None:
                constant -= factor
            else:
                total[name] = total.get(name, Fraction(0)) + factor
    constraint = LinearConstraint(tuple(total.items()), sense, constant)
    return negation(constraint) if node.getKind() == Kind.DISTINCT else constraint


def _terms(term: Any, weight: Fraction) -> Iterator[tuple[str | None, Fraction]]:  # noqa: PLR0912 - a branch a kind
    """Names with their coefficients, and numbers without a name."""
    stack = [(term, weight)]
    while stack:
        node, factor = stack.pop()
        kind = node.getKind()
        if node.isRealValue() or node.isIntegerValue():
            yield None, factor * _value(node)
        elif kind == Kind.ADD:
            stack += [(child, factor) for child in node]
        elif kind == Kind.SUB:
            stack += [(child, factor if index == 0 else -factor) for index, child in enumerate(node)]
        elif kind == Kind.NEG:
            stack.append((node[0], -factor))
        elif kind == Kind.TO_REAL:
            stack.append((node[0], factor))
        elif kind == Kind.MULT:
            rest = None
            for child in node:
                if child.isRealValue() or child.isIntegerValue():
                    factor *= _value(child)
                elif rest is None:
                    rest = child
                else:
                    raise UnsupportedError(f"cvc5 left the product {node} in its result")
            if rest is None:
                yield None, factor
            else:
                stack.append((rest, factor))
        elif kind == Kind.CONSTANT:
            yield node.getSymbol(), factor
        else:
            raise UnsupportedError(f"cvc5 left the term {node} in its result")


def _value(node: Any) -> Fraction:
    return Fraction(node.getRealValue() if node.isRealValue() else node.getIntegerValue())
