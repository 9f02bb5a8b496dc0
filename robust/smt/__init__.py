"""The one door to the solvers: formulas, incremental sessions with time limits, statistics and SMT-LIB export."""
