"""Exported queries: z3's and cvc5's own parsers read them and reach the verdict that the file claims."""

from fractions import Fraction

import cvc5
import pytest
import z3

from robust.api import check, envelope
from robust.encode.interface import Auxiliary, variable
from robust.plan.model import ZERO, Or, Parameter, ParameterReference
from robust.smt.session import Exporter, Session, smtlib
from robust.smt.terms import Terms
from tests.plan.building import ALL, END, F, above, action, between, different, flow, plan_of, reference, value


def read_by_z3(text: str) -> str:
    solver = z3.Solver()
    solver.from_string(text)
    return str(solver.check())


def read_by_cvc5(text: str) -> str:
    tm = cvc5.TermManager()
    solver = cvc5.Solver(tm)
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, text, "exported")
    symbols = parser.getSymbolManager()
    answer = ""
    while not (command := parser.nextCommand()).isNull():
        answer += str(command.invoke(solver, symbols))
    return answer.strip()


def agree(text: str) -> str:
    """The verdict, which the file itself and both parsers must agree on."""
    (claimed,) = (line.removeprefix("; answer: ") for line in text.splitlines() if line.startswith("; answer: "))
    assert read_by_z3(text) == claimed
    assert read_by_cvc5(text) == claimed
    return claimed


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_every_exported_query_is_read_and_answered_alike(tmp_path, solver) -> None:
    k = reference("k")
    i = action("i", flow(F, -1), (ALL, Or((above(value(F), 1), different(value(F), -1)))))
    j = action("j", flow(F, 2), (END, above(value(F), 1)))
    lengths = (between(i.start, i.end, 1, k + 1), between(j.start, j.end, 4, 6))
    constraints = (between(ZERO, i.start, 1, 1), between(ZERO, j.start, 0, k), *lengths)
    plan = plan_of(i, j, f=3, constraints=constraints, parameters=(Parameter("k", Fraction(3)),))
    check(plan, every=True, solver=solver, smt2=tmp_path / "check")
    envelope(plan, method="irr", beta=Fraction(1, 2), solver=solver, smt2=tmp_path / "envelope")
    files = sorted(tmp_path.rglob("*.smt2"))
    verdicts = {agree(path.read_text(encoding="utf-8")) for path in files}
    assert verdicts == {"sat", "unsat"}
    assert [path.name[:5] for path in sorted((tmp_path / "check").iterdir())][:2] == ["00001", "00002"]


@pytest.mark.parametrize(
    "name",
    ["k", "i0.k", "2k", "let", "and", "true", "Real", "check-sat", "_", "!", "as", "BINARY", "-k", "k:k", "é", "k#"],
)
def test_any_parameter_name_can_be_exported(tmp_path, name) -> None:
    terms = Terms()
    expression = variable(ParameterReference(name)) - Fraction(1, 3)
    session = Session(terms, exporter=Exporter(tmp_path))
    session.add(terms.greater(expression), terms.fresh_boolean("[(p a) before i.start]"))
    session.check("a name")
    session.add(terms.greater(-expression))
    session.check("a name, contradicted")
    assert [agree(path.read_text(encoding="utf-8")) for path in sorted(tmp_path.iterdir())] == ["sat", "unsat"]


def test_scripts_of_nothing_of_exact_numbers_and_of_questions_of_several_lines() -> None:
    terms = Terms()
    tiny, x = Fraction(-1, 3**40), variable(Auxiliary("x", 1))
    text = smtlib(terms, [terms.greater(x), terms.greater(-x)], "first\nsecond (assert true)", "unsat")
    assert text.splitlines()[:3] == ["; first", "; second (assert true)", "; answer: unsat"]
    assert agree(text) == "unsat"
    assert agree(smtlib(Terms(), [], "nothing", "sat")) == "sat"
    for relation, answer in ((terms.equal, "sat"), (terms.greater, "unsat")):
        text = smtlib(terms, [terms.equal(x.scaled(tiny) - tiny * 2), relation(x - 2)], "exact", answer)
        assert agree(text) == answer


def test_files_are_numbered_and_named_after_the_question(tmp_path) -> None:
    exporter = Exporter(tmp_path / "new" / "directory")
    terms = Terms()
    first = exporter.write(terms, [], "i0 act: over all (>= (f) 1)", "sat")
    second = exporter.write(terms, [], "x" * 200, "unknown")
    assert (first.name, second.name) == ("00001-i0-act-over-all-f-1.smt2", f"00002-{'x' * 60}.smt2")
