"""The positions encoding: time points in a total order, fluents per position, frame axioms per step [IRR §2]."""
