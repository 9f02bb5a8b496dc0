"""Labeled causal links, and the augmented plan that makes them choices."""
