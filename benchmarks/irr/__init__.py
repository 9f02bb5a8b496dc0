"""The experiments about robustness envelopes: the figures and tables of [IRR], and how ours scale."""
