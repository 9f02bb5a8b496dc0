"""The methods that find a box, by name, and what each of them can be given."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Unpack

from robust.encode.interface import Encoding
from robust.irr.containment import Containment
from robust.irr.exact import ExactSearch
from robust.irr.irr import IncrementalRobustification
from robust.irr.search import BoxSearch, Conduct
from robust.smt.export import Exporter


@dataclass(frozen=True, slots=True)
class BoxMethod:
    """How a box is found.

    Attributes:
        name: `widen`, `irr` or `optimal`.
        beta: the precision of `irr`, in the parameters' units.
        doubling: whether `irr` doubles its steps until the first failure, as in its published runs.
        order: parameters in the order in which `irr` and `widen` take them; others follow in the plan's order.
        contain_nominal: whether the `optimal` box must contain the nominal point; other boxes always do.
    """

    name: str = "widen"
    beta: Fraction = Fraction(1)
    doubling: bool = False
    order: tuple[str, ...] = ()
    contain_nominal: bool = True

    def search(
        self, formulas: Encoding, *, solver: str, exporter: Exporter | None = None, **conduct: Unpack[Conduct]
    ) -> BoxSearch:
        """The search for a box of a plan.

        Raises:
            InputError: if `order` names unknown or repeated parameters.
        """
        if self.name == "irr":
            containment = Containment(formulas, solver=solver, exporter=exporter)
            return IncrementalRobustification(
                containment, beta=self.beta, doubling=self.doubling, order=self.order, **conduct
            )
        return ExactSearch(
            formulas,
            method=self.name,
            order=self.order,
            contain_nominal=self.contain_nominal,
            solver=solver,
            exporter=exporter,
            **conduct,
        )
