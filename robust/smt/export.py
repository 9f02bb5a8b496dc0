"""Every query as an SMT-LIB file that any solver can read."""

from __future__ import annotations

import re
from collections.abc import Iterable
from io import StringIO
from pathlib import Path

from pysmt.smtlib.printers import SmtDagPrinter
from pysmt.utils import quote

from robust.files import Folder
from robust.smt.terms import Formula, Terms


class Exporter:
    """Writes numbered `.smt2` files into a directory, one for each query, with the question and the answer as comments.

    Raises:
        InputError: if the directory cannot be made. A file that cannot be written is a warning.
    """

    def __init__(self, directory: str | Path) -> None:
        self._folder = Folder(directory, "SMT-LIB files")
        self._count = 0

    def write(self, terms: Terms, assertions: Iterable[Formula], question: str, answer: str) -> Path:
        self._count += 1
        stem = re.sub(r"[^A-Za-z0-9.]+", "-", question).strip("-")[:60]
        return self._folder.write(f"{self._count:05d}-{stem}.smt2", smtlib(terms, assertions, question, answer))


def smtlib(terms: Terms, assertions: Iterable[Formula], question: str, answer: str) -> str:
    """One query as an SMT-LIB 2.6 script; shared subterms are bound by `let`.

    Symbols that have a reserved word for a name are written with a space before it.
    """
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
