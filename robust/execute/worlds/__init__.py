"""Simulated worlds: durations and consumption drawn from distributions, actions carried out as the model says."""
