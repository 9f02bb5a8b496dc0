"""Many independent tasks: on this machine or on a cluster, with a store from which a later run resumes."""

from robust.bench.sweep.run import Failure, Sweep, run_sweep
from robust.bench.sweep.task import Task, key_of

__all__ = ["Failure", "Sweep", "Task", "key_of", "run_sweep"]
