"""Execution with re-planning from the state reached [IRR §3, Figure 1]."""
