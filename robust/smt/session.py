"""Formulas, and incremental sessions with a solver that is asked about them.

Formulas are of linear real arithmetic over polynomials, with constants folded before any solver sees them. pySMT, and
z3 with it, is loaded with the first one: questions that shortest paths answer build none. Sessions have frames of
assertions, time limits and models, and count what was asked at what cost; every query can be written as an SMT-LIB
file that any solver can read.
"""

from __future__ import annotations

import gc
import logging
import re
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from ctypes import c_longlong, pointer
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from functools import cache, cached_property
from importlib import import_module
from importlib.util import LazyLoader, find_spec, module_from_spec
from io import StringIO
from pathlib import Path
from typing import Any, TypeAlias

from robust import presented, records
from robust.errors import SolverError, UnsupportedError, did_you_mean
from robust.plan.model import Relation
from robust.plan.polynomial import Polynomial
from robust.smt.limits import NEVER, Deadline, OutOfTimeError, current_question, from_copy, raise_if_interrupted

Formula: TypeAlias = Any
"""A node of pySMT, which declares no types."""
Build: TypeAlias = Callable[[list[Formula]], Formula]


_PARTS = {
    "formula_manager": ("formula", "FormulaManager"),
    "type_manager": ("typing", "TypeManager"),
    "stc": ("type_checker", "SimpleTypeChecker"),
    "factory": ("factory", "Factory"),
    "simplifier": ("simplifier", "Simplifier"),
    "substituter": ("substituter", "MGSubstituter"),
    "serializer": ("printers", "HRSerializer"),
    "qfo": ("oracles", "QuantifierOracle"),
    "theoryo": ("oracles", "TheoryOracle"),
    "fvo": ("oracles", "FreeVarsOracle"),
    "sizeo": ("oracles", "SizeOracle"),
    "ao": ("oracles", "AtomsOracle"),
    "typeso": ("oracles", "TypesOracle"),
}


def _load_lazily(name: str) -> None:
    """Let a module be loaded when something of it is first asked for: texts of formulas, and cvc5, do."""
    package, _, last = name.rpartition(".")
    if name not in sys.modules and (spec := find_spec(name)) is not None and spec.loader is not None:
        spec.loader = LazyLoader(spec.loader)
        sys.modules[name] = module = module_from_spec(spec)
        spec.loader.exec_module(module)
        setattr(sys.modules[package], last, module)


class _Environment:
    """What pySMT's formulas and solvers ask of their environment, each part loaded and made when it is first needed.

    pySMT's own loads and makes everything at once, multiprocessing with it, which takes longer than most use of it.
    """

    enable_infix_notation = allow_empty_var_names = False
    enable_div_by_0 = True

    def __init__(self) -> None:
        self.dwf: dict[Any, Any] = {}

    def __getattr__(self, name: str) -> Any:
        if name not in _PARTS:
            raise AttributeError(name)
        module, kind = _PARTS[name]
        part = getattr(import_module(f"pysmt.{module}"), kind)(self)
        setattr(self, name, part)
        return part


class Terms:
    """Builds pySMT formulas in an environment of its own; symbols stand for any printable variables."""

    def __init__(self) -> None:
        self._symbols: dict[Hashable, Formula] = {}
        self.translations: dict[str, Any] = {}
        """What solvers have translated of this environment's formulas already, by solver."""
        self._variables: dict[Formula, frozenset[Formula]] = {}
        self._sizes: dict[Formula, int] = {}
        self._comparisons: dict[tuple[Polynomial[Hashable], Relation], Formula] = {}

    @cached_property
    def environment(self) -> Any:
        """pySMT's home of these formulas."""
        _load_lazily("pysmt.environment")
        return _Environment()

    @cached_property
    def manager(self) -> Any:
        """Makes the nodes."""
        manager = self.environment.formula_manager
        # Terms are of the right type by construction; checking every node takes longer than making it.
        manager._do_type_check = lambda _node: None
        return manager

    @cached_property
    def _types(self) -> Any:
        from pysmt import typing  # noqa: PLC0415 - loaded with the first formula

        return typing

    @cached_property
    def true(self) -> Formula:
        """The constant."""
        return self.manager.TRUE()

    @cached_property
    def false(self) -> Formula:
        """The constant."""
        return self.manager.FALSE()

    def real(self, variable: Hashable) -> Formula:
        """The real-valued symbol of a variable, named after it."""
        if variable not in self._symbols:
            self._symbols[variable] = self.manager.Symbol(str(variable), self._types.REAL)
        return self._symbols[variable]

    def fresh_boolean(self, name: str) -> Formula:
        return self.manager.FreshSymbol(self._types.BOOL, f"{name}%d")

    def truth(self, value: bool) -> Formula:
        return self.true if value else self.false

    def negation(self, formula: Formula) -> Formula:
        if formula is self.true:
            return self.false
        if formula is self.false:
            return self.true
        return formula.arg(0) if formula.is_not() else self.manager.Not(formula)

    def conjunction(self, formulas: Iterable[Formula]) -> Formula:
        return self._junction(formulas, self.true, self.false, self.manager.And)

    def disjunction(self, formulas: Iterable[Formula]) -> Formula:
        return self._junction(formulas, self.false, self.true, self.manager.Or)

    def _junction(self, formulas: Iterable[Formula], neutral: Formula, absorbing: Formula, build: Build) -> Formula:
        operands: dict[Formula, None] = {}
        for formula in formulas:
            if formula is absorbing:
                return absorbing
            if formula is not neutral:
                operands[formula] = None
        if not operands:
            return neutral
        if len(operands) == 1:
            return next(iter(operands))
        return build(list(operands))

    def implication(self, condition: Formula, consequence: Formula) -> Formula:
        return self.disjunction((self.negation(condition), consequence))

    def equivalence(self, left: Formula, right: Formula) -> Formula:
        return self.manager.Iff(left, right)

    def number(self, value: Fraction) -> Formula:
        return self.manager.Real(value)

    def linear(self, expression: Polynomial[Hashable]) -> Formula:
        """A linear polynomial as a real term.

        Raises:
            UnsupportedError: if a product of variables is left.
        """
        if not expression.is_linear:
            raise UnsupportedError(
                f"non-linear arithmetic: {expression} multiplies unknowns; expected a product with at most one factor "
                "that is not constant"
            )
        terms = [
            self.real(variable) if factor == 1 else self.manager.Times(self.number(factor), self.real(variable))
            for variable, factor in expression.coefficients()
        ]
        if expression.constant_term or not terms:
            terms.append(self.number(expression.constant_term))
        return terms[0] if len(terms) == 1 else self.manager.Plus(terms)

    def compare(self, expression: Polynomial[Hashable], relation: Relation) -> Formula:
        """`expression relation 0`; a constant expression is decided here."""
        if expression.is_constant:
            return self.truth(relation.holds(expression.constant_term))
        key = (expression, relation)
        if key not in self._comparisons:
            build = {
                Relation.AT_LEAST: self.manager.GE,
                Relation.GREATER: self.manager.GT,
                Relation.EQUAL: self.manager.Equals,
                Relation.DIFFERENT: self.manager.NotEquals,
            }[relation]
            self._comparisons[key] = build(self.linear(expression), self.number(Fraction(0)))
        return self._comparisons[key]

    def at_least(self, expression: Polynomial[Hashable]) -> Formula:
        return self.compare(expression, Relation.AT_LEAST)

    def greater(self, expression: Polynomial[Hashable]) -> Formula:
        return self.compare(expression, Relation.GREATER)

    def equal(self, expression: Polynomial[Hashable]) -> Formula:
        return self.compare(expression, Relation.EQUAL)

    def size(self, formula: Formula) -> int:
        """The number of distinct nodes of a formula."""
        if formula not in self._sizes:
            seen, queue = {formula}, [formula]
            for node in queue:
                new = [argument for argument in node.args() if argument not in seen]
                seen.update(new)
                queue += new
            self._sizes[formula] = len(seen)
        return self._sizes[formula]

    def variables(self, formula: Formula) -> frozenset[Formula]:
        """The symbols that occur in a formula."""
        if formula not in self._variables:
            self._variables[formula] = frozenset(self.environment.fvo.get_free_variables(formula))
        return self._variables[formula]


@dataclass(slots=True)
class Statistics:
    """Counts over all sessions that share it: queries by verdict, seconds in solvers, nodes of asserted formulas.

    `failures` say why solvers gave no verdict, where it was not for lack of time.
    """

    queries: int = 0
    satisfiable: int = 0
    unsatisfiable: int = 0
    unknown: int = 0
    seconds: float = 0.0
    nodes: int = 0
    failures: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, float | int]:
        """The counts."""
        counts = {**asdict(self), "seconds": round(self.seconds, 6)}
        del counts["failures"]
        return counts

    @property
    def failure(self) -> str | None:
        """The first of the failures, and how many there are."""
        others = f" (and {len(self.failures) - 1} more)" if len(self.failures) > 1 else ""
        return f"{self.failures[0]}{others}" if self.failures else None


Value = Fraction | bool
log = logging.getLogger(__name__)


class Satisfiability(presented.VerdictEnum):
    """What a solver says of a query; UNKNOWN covers time-outs and crashes."""

    SATISFIABLE = "sat"
    UNSATISFIABLE = "unsat"
    UNKNOWN = "unknown"


class Backend(ABC):
    """One incremental solver of quantifier-free linear real arithmetic."""

    name: str

    def __init__(self, terms: Terms, *, proving: bool = False) -> None:
        self._terms = terms
        self.failure: str | None = None
        """Why the last check has no verdict, where it is not for lack of time."""
        self._solver = self._create(terms, proving)

    @abstractmethod
    def _create(self, terms: Terms, proving: bool) -> Any: ...

    def add(self, formula: Formula) -> None:
        self._solver.add_assertion(formula)

    def push(self) -> None:
        self._solver.push()

    def pop(self) -> None:
        self._solver.pop()

    @abstractmethod
    def check(self, deadline: Deadline, symbols: Callable[[], Iterable[Formula]], effort: int = 0) -> Satisfiability:
        """Decide the asserted formulas; `symbols` gives those whose values may be asked for afterwards.

        With an effort the answer may be UNKNOWN after so many steps of the solver, if it counts them.
        """

    def values(self, symbols: Iterable[Formula]) -> dict[str, Value]:
        """The model of the last satisfiable check."""
        return {symbol.symbol_name(): _python_value(self._solver.get_value(symbol)) for symbol in symbols}


@cache
def _context_class() -> Any:
    """z3's context, forgotten before it is freed.

    z3's own class frees first: Ctrl-C raised in between leaves a pointer that the translations, finalised after it,
    would follow.
    """
    import z3  # noqa: PLC0415 - slow to import

    class OwnContext(z3.Context):  # type: ignore[misc]
        def __del__(self) -> None:
            context: Any = self.ref()
            self.ctx = None
            self.eh = None
            if context is not None and self.owner and z3.Z3_del_context is not None:
                z3.Z3_del_context(context)

    return OwnContext


@contextmanager
def _keeping_terms() -> Iterator[None]:
    """Nothing collects garbage meanwhile: in another thread, that would free terms of a context that this one uses."""
    usual = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if usual:
            gc.enable()


class Z3(Backend):
    """z3 stops at once on Ctrl-C and keeps time limits by itself."""

    name = "z3"

    def _create(self, terms: Terms, proving: bool) -> Any:
        self._effort = 0
        self._model: Any = None
        """Of the last check, once it was asked for."""
        self._declarations: dict[Formula, tuple[Any, str, bool]] = {}
        """Of symbols whose values were read: z3's declaration, the name, and whether it is a truth value."""
        self._numbers = pointer(c_longlong()), pointer(c_longlong())
        solver = _pysmt_solver(terms, self.name, "z3", "Z3Solver")
        import z3  # noqa: PLC0415 - slow to import

        # All sessions of one environment share what has been translated already.
        if self.name not in terms.translations:
            question = current_question()
            if question is not None and not question.first:
                question.context = question.context or _context_class()()
                solver.converter = type(solver.converter)(terms.environment, question.context)
            terms.translations[self.name] = solver.converter
        solver.converter = terms.translations[self.name]
        context = solver.converter.ctx
        if proving:
            # Without tactics in between, and with z3's earlier arithmetic: hard proofs take half the time.
            solver.z3 = z3.SimpleSolver(context)
            solver.z3.set("arith.solver", 2)
        elif context is not z3.main_ctx():
            solver.z3 = z3.SolverFor("QF_LRA", context)
        return solver

    @_keeping_terms()
    def add(self, formula: Formula) -> None:
        super().add(formula)

    @_keeping_terms()
    def check(self, deadline: Deadline, symbols: Callable[[], Iterable[Formula]], effort: int = 0) -> Satisfiability:
        remaining = deadline.remaining
        # Zero means "no limit" to z3, and a limit that has passed must still return at once.
        milliseconds = 4294967295 if remaining is None else max(1, int(remaining * 1000))
        self._solver.z3.set("timeout", milliseconds)
        if effort != self._effort:
            self._effort = effort
            self._solver.z3.set("rlimit", effort)
        before = self._steps() if effort else 0
        self._model = None
        begun = time.monotonic()
        verdict = _solve(self._solver)
        given_up = effort and verdict is Satisfiability.UNKNOWN and self._steps() - before >= effort
        in_time = remaining is None or time.monotonic() - begun < remaining - 0.1
        if verdict is Satisfiability.UNKNOWN and not given_up and self._was_interrupted(in_time):
            # z3's own handler takes the signal while it works, so Python never hears of it.
            raise KeyboardInterrupt
        return verdict

    @_keeping_terms()
    def values(self, symbols: Iterable[Formula]) -> dict[str, Value]:
        """Values of symbols in the model of the last check; 0 or false for those that it says nothing about.

        They are read through z3's C interface, because models have many values: objects take ten times as long.
        """
        from z3 import z3core  # noqa: PLC0415 - slow to import

        if self._model is None:
            self._model = self._solver.z3.model()
        model, context, numbers = self._model.model, self._solver.converter.ctx.ref(), self._numbers
        values: dict[str, Value] = {}
        for symbol in symbols:
            if symbol not in self._declarations:
                term = self._solver.converter.convert(symbol)
                self._declarations[symbol] = term.decl().ast, symbol.symbol_name(), symbol.symbol_type().is_bool_type()
            declaration, name, boolean = self._declarations[symbol]
            value = z3core.Z3_model_get_const_interp(context, model, declaration)
            if boolean:
                values[name] = bool(value) and z3core.Z3_get_bool_value(context, value) == 1
            elif not value:
                values[name] = Fraction(0)
            elif z3core.Z3_get_numeral_rational_int64(context, value, *numbers):
                values[name] = Fraction(numbers[0].contents.value, numbers[1].contents.value)
            else:
                values[name] = Fraction(z3core.Z3_get_numeral_string(context, value))
        return values

    def _steps(self) -> int:
        """What this solver has spent by now, in the unit of an effort."""
        statistics = self._solver.z3.statistics()
        return int(statistics.get_key_value("rlimit count")) if "rlimit count" in statistics.keys() else 0  # noqa: SIM118

    def _was_interrupted(self, in_time: bool) -> bool:
        """z3 gives the same reason for a time limit as for some interruptions; then the clock tells them apart.

        Not what is left of the deadline: of processor time much may be, when other work takes the processor.
        """
        reason = self._solver.z3.reason_unknown()
        return "interrupted" in reason or ("canceled" in reason and in_time)


class Cvc5(Backend):
    """cvc5 in a copy of this process for each question.

    cvc5 cannot be interrupted while Python waits for it, and now and then it aborts, which ends the process that it
    runs in. Here it only holds terms; a forked copy solves, sends back verdict and values, and can be ended.
    """

    name = "cvc5"

    def _create(self, terms: Terms, proving: bool) -> Any:
        self._frames: list[list[Any]] = [[]]
        self._values: Mapping[str, Value] = {}
        # All sessions of one environment share what has been translated already.
        if self.name not in terms.translations:
            terms.translations[self.name] = _pysmt_solver(terms, self.name, "cvcfive", "CVC5Solver")
        return terms.translations[self.name]

    def add(self, formula: Formula) -> None:
        self._frames[-1].append(self._solver.converter.convert(formula))

    def push(self) -> None:
        self._frames.append([])

    def pop(self) -> None:
        self._frames.pop()

    def check(self, deadline: Deadline, symbols: Callable[[], Iterable[Formula]], effort: int = 0) -> Satisfiability:
        def answer() -> tuple[Satisfiability, Mapping[str, Value]]:
            for term in (term for frame in self._frames for term in frame):
                self._solver.cvc5.assertFormula(term)
            verdict = _solve(self._solver)
            return verdict, super(Cvc5, self).values(symbols()) if verdict is Satisfiability.SATISFIABLE else {}

        self.failure = None
        try:
            verdict, self._values = from_copy(answer, deadline.on_clock, self.name)
        except OutOfTimeError:
            return Satisfiability.UNKNOWN
        except SolverError as error:
            self.failure = error.message
            return Satisfiability.UNKNOWN
        return verdict

    def values(self, symbols: Iterable[Formula]) -> dict[str, Value]:
        return {symbol.symbol_name(): self._values[symbol.symbol_name()] for symbol in symbols}


BACKENDS: Mapping[str, type[Backend]] = {"z3": Z3, "cvc5": Cvc5}


def create_backend(name: str, terms: Terms, *, proving: bool = False) -> Backend:
    """The solver of that name, see :class:`Session`.

    Raises:
        SolverError: if there is no such solver or it is not installed.
    """
    if name not in BACKENDS:
        raise SolverError(f"unknown solver {name!r}{did_you_mean(name, BACKENDS)}")
    return BACKENDS[name](terms, proving=proving)


def _pysmt_solver(terms: Terms, name: str, module: str, solver_class: str) -> Any:
    """pySMT's adapter, taken directly: its factory would import every solver that is installed."""
    from pysmt.exceptions import SolverAPINotFound  # noqa: PLC0415 - loaded with the first session, as z3 is
    from pysmt.logics import QF_LRA  # noqa: PLC0415 - likewise

    try:
        adapter = getattr(import_module(f"pysmt.solvers.{module}"), solver_class)
    except (ImportError, SolverAPINotFound) as error:
        raise SolverError(f"solver {name!r} is not installed; expected the Python package of that solver") from error
    solver = adapter(environment=terms.environment, logic=QF_LRA, incremental=True)
    # pySMT checks the type of every assertion in its global environment, which then keeps all formulas for good. Terms
    # are of the right type by construction.
    solver._assert_is_boolean = lambda _formula: None
    return solver


def _solve(solver: Any) -> Satisfiability:
    from pysmt.exceptions import SolverReturnedUnknownResultError  # noqa: PLC0415 - likewise

    try:
        return Satisfiability.SATISFIABLE if solver.solve() else Satisfiability.UNSATISFIABLE
    except SolverReturnedUnknownResultError:
        return Satisfiability.UNKNOWN


def _python_value(constant: Formula) -> Value:
    value = constant.constant_value()
    return value if isinstance(value, bool) else Fraction(value.numerator, value.denominator)


class Session:
    """A stack of assertions in one solver.

    With `proving` the solver is set to what proves most quickly that there is no model; it may find other models then.
    Several sessions may share a `statistics` and an `exporter`. Ctrl-C ends a running query at once with
    `KeyboardInterrupt`; the session is not to be used after that.

    Raises:
        SolverError: if the solver is unknown or not installed.
    """

    def __init__(
        self,
        terms: Terms,
        *,
        solver: str = "z3",
        statistics: Statistics | None = None,
        exporter: Exporter | None = None,
        proving: bool = False,
    ) -> None:
        self.terms = terms
        self.solver = solver
        self.statistics = statistics or Statistics()
        self.failure: str | None = None
        """Why the last check has no verdict, where it is not for lack of time."""
        self._exporter = exporter
        self._backend = create_backend(solver, terms, proving=proving)
        self._frames: list[list[Formula]] = [[]]
        self._symbols: list[set[Formula]] = [set()]

    def add(self, *formulas: Formula) -> None:
        """Assert formulas in the current frame; constants that are true cost nothing."""
        for formula in formulas:
            if formula is not self.terms.true:
                self._frames[-1].append(formula)
                self._symbols[-1] |= self.terms.variables(formula)
                self._backend.add(formula)
                self.statistics.nodes += self.terms.size(formula)

    def add_all(self, formulas: Iterable[Formula], deadline: Deadline) -> None:
        """Add many formulas, whose translation may take long, as :meth:`add` does.

        Raises:
            OutOfTimeError: if the deadline passes; the session is not to be used after that.
        """
        for formula in formulas:
            deadline.enforce()
            self.add(formula)

    @contextmanager
    def frame(self, *formulas: Formula) -> Iterator[None]:
        """Assert formulas for the duration of the block."""
        self._frames.append([])
        self._symbols.append(set())
        self._backend.push()
        try:
            self.add(*formulas)
            yield
        finally:
            self._frames.pop()
            self._symbols.pop()
            self._backend.pop()

    @property
    def assertions(self) -> list[Formula]:
        return [formula for frame in self._frames for formula in frame]

    def check(self, question: str, deadline: Deadline = NEVER, effort: int = 0) -> Satisfiability:
        """Whether the assertions have a model; `question` names the query in logs and exported files.

        With an effort the solver may give up after so many of its steps, the same ones in every run: UNKNOWN.
        """
        raise_if_interrupted()
        if deadline.passed:
            return Satisfiability.UNKNOWN
        started = time.perf_counter()
        verdict = self._backend.check(deadline, self._asserted_symbols, effort)
        seconds = time.perf_counter() - started
        self._count(verdict, seconds)
        self.failure = None
        if verdict is Satisfiability.UNKNOWN and self._backend.failure is not None:
            self.failure = f"{self._backend.failure}, asked: {question}"
            self.statistics.failures.append(self.failure)
        log.debug("%s: %s in %.4f s", question, verdict.value, seconds)
        if self._exporter is not None:
            self._exporter.write(self.terms, self.assertions, question, verdict.value)
        return verdict

    def values(self, symbols: Iterable[Formula]) -> dict[str, Value]:
        """Values by symbol name in the model of the last satisfiable check; symbols never asserted are left out."""
        asserted = self._asserted_symbols()
        return self._backend.values([symbol for symbol in symbols if symbol in asserted])

    def _asserted_symbols(self) -> set[Formula]:
        return set().union(*self._symbols)

    def _count(self, verdict: Satisfiability, seconds: float) -> None:
        self.statistics.queries += 1
        self.statistics.seconds += seconds
        match verdict:
            case Satisfiability.SATISFIABLE:
                self.statistics.satisfiable += 1
            case Satisfiability.UNSATISFIABLE:
                self.statistics.unsatisfiable += 1
            case Satisfiability.UNKNOWN:
                self.statistics.unknown += 1


class Exporter:
    """Writes numbered `.smt2` files into a directory, one for each query, with the question and the answer as comments.

    Raises:
        InputError: if the directory cannot be made. A file that cannot be written is a warning.
    """

    def __init__(self, directory: str | Path) -> None:
        self._folder = records.Folder(directory, "SMT-LIB files")
        self._count = 0

    def write(self, terms: Terms, assertions: Iterable[Formula], question: str, answer: str) -> Path:
        self._count += 1
        stem = re.sub(r"[^A-Za-z0-9.]+", "-", question).strip("-")[:60]
        return self._folder.write(f"{self._count:05d}-{stem}.smt2", smtlib(terms, assertions, question, answer))


def smtlib(terms: Terms, assertions: Iterable[Formula], question: str, answer: str) -> str:
    """One query as an SMT-LIB 2.6 script; shared subterms are bound by `let`.

    Symbols that have a reserved word for a name are written with a space before it.
    """
    from pysmt.smtlib.printers import SmtDagPrinter  # noqa: PLC0415 - imports z3
    from pysmt.utils import quote  # noqa: PLC0415 - likewise

    conjunction = terms.conjunction(assertions)
    renamed = {
        symbol: terms.manager.Symbol(f" {symbol.symbol_name()}", symbol.symbol_type())
        for symbol in terms.variables(conjunction)
        if symbol.symbol_name() in RESERVED
    }
    if renamed:
        conjunction = terms.environment.substituter.substitute(conjunction, renamed)
    symbols = sorted(terms.variables(conjunction), key=lambda symbol: symbol.symbol_name())
    lines = [f"; {line}" for line in question.splitlines()]
    lines += [f"; answer: {answer}", "(set-logic QF_LRA)"]
    lines += [f"(declare-fun {quote(symbol.symbol_name())} () {symbol.symbol_type()})" for symbol in symbols]
    for assertion in conjunction.args() if conjunction.is_and() else [conjunction]:
        buffer = StringIO()
        SmtDagPrinter(buffer).printer(assertion)
        lines.append(f"(assert {buffer.getvalue()})")
    return "\n".join([*lines, "(check-sat)", ""])


_RESERVED = (
    "_ ! as let exists forall match par true false not and or xor ite distinct div mod abs to_real to_int is_int "
    "Bool Int Real String BINARY DECIMAL HEXADECIMAL NUMERAL STRING assert check-sat declare-fun"
)
RESERVED = frozenset(_RESERVED.split())
"""Words of SMT-LIB and of its theories that quoting does not turn into ordinary symbols for every solver."""
