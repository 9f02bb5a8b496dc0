"""Benchmark drivers: recorded runs of a data set beside ours, and how our runs scale."""
