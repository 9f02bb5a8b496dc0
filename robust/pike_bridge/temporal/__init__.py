"""Temporal reasoning over plans with choices: labeled value sets, labeled shortest paths, precedence, conflicts."""
