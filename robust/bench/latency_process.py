"""One simulated execution as a process: `python -m robust.bench.latency_process SEED INDEX BACKEND LIMIT`.

Prints one JSON object; started by :mod:`robust.bench.figure20b`, so that executions do not disturb each other.
"""

from __future__ import annotations

import gc
import json
import sys
from dataclasses import asdict

from robust.bench.latency import measure_latency
from robust.smt.limits import Deadline


def main() -> None:
    seed, index, backend, limit = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], float(sys.argv[4])
    # What the libraries brought is not looked at again by garbage collection, whose pauses would count as decisions.
    gc.freeze()
    found = measure_latency(index, seed=seed, backend=backend, deadline=Deadline.after(limit))
    print(json.dumps(asdict(found)))  # noqa: T201 - what the parent reads


if __name__ == "__main__":
    main()
