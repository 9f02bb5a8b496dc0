"""`python -m benchmarks NAME`: the same as `robust bench NAME`."""

from __future__ import annotations

import sys

from robust.cli import run

if __name__ == "__main__":
    raise SystemExit(run(["bench", *sys.argv[1:]]))
