"""SMT-first formal verification of temporal plans: validity, robustness envelopes, and why to believe them."""

__version__ = "0.1.0"
