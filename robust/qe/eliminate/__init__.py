"""Quantifier elimination back ends behind one interface; see :mod:`robust.qe.eliminate.interface`."""
