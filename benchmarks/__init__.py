"""The experiments: one engine, one file for each figure or table, and the generators that only they use.

:mod:`benchmarks.catalogue` lists them. `robust bench NAME` and `python -m benchmarks NAME` run them; the page with
results is written by :mod:`benchmarks.results`. A wheel holds this package as `robust_benchmarks`.
"""
