"""Instances of the generating-set domain in any size, for scaling studies.

`python -m benchmarks.generate --refuels 20 --parameters 4 --output DIRECTORY` writes domain, problem and plan.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from robust.bench.generator import generator_instance, nominal_start, write_instance

__all__ = ["generator_instance", "main", "nominal_start", "write_instance"]


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.generate", description=__doc__)
    parser.add_argument("--refuels", type=int, required=True, metavar="N", help="number of refuel actions")
    parser.add_argument("--parameters", type=int, required=True, metavar="K", help="number of parameters, at most N")
    parser.add_argument(
        "--output", type=Path, default=Path(), metavar="DIRECTORY", help="default: the current directory"
    )
    options = parser.parse_args(arguments)
    try:
        paths = write_instance(options.output, options.refuels, options.parameters)
    except (ValueError, OSError) as error:
        parser.error(str(error))
    print(*paths, sep="\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
