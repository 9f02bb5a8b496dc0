"""Every test of all elimination back ends is one of the referees, too: z3's older tactic, and cvc5 in one go."""

from collections.abc import Iterable, Iterator

from robust.backends import ELIMINATORS
from robust.qe.eliminate.cvc5_native import Cvc5Disjuncts, _Native, _shape
from robust.qe.eliminate.z3_tactics import Z3Tactic
from robust.qe.nnf import ExpressionReader, Nnf

REFEREES = {"z3-qe": (__name__, "Z3OldTactic"), "cvc5-whole": (__name__, "Cvc5Whole")}
"""As in :data:`robust.backends.ELIMINATORS`."""

ELIMINATORS.update(REFEREES)


class Z3OldTactic(Z3Tactic):
    """z3's `qe`."""

    name = "z3-qe"
    tactic = "qe"


class Cvc5Whole(Cvc5Disjuncts):
    """`getQuantifierElimination`."""

    name = "cvc5-whole"

    def _work(self, formula: Nnf, eliminated: Iterable[str]) -> Iterator[Nnf]:
        native = _Native(formula)
        yield ExpressionReader(_shape).read(native.solver.getQuantifierElimination(native.exists(formula, eliminated)))
