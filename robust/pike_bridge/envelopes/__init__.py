"""Envelopes of plans with choices: for which durations and limits which choices still lead to a correct execution."""
