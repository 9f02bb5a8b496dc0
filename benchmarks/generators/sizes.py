"""Plans of any size for studies of growth: of the generating-set domain, and of unordered jobs.

Of the generating set all canisters are alike, so only the order of times matters. The jobs may start at any time of the
first 100 minutes, in any order. Each drains as much energy as it takes minutes, all at once when it ends; a watch that
lasts through all of them needs energy left. Nothing orders the 2 N starts and ends of N jobs, but for each end to be
after its start; the envelope is one polyhedron whatever their order is.

`python -m benchmarks.generators.sizes --refuels 20 --parameters 4 --output DIRECTORY` writes an instance of the
generating set.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import robust
from robust.plan.pddl.forms import read_text

from ..engine.measure import Files, write_files

GENERATING_SET = Path(robust.__file__).parent / "examples" / "generator" / "domain.pddl"

CONTENT = 36
"""Litres in a canister, which last as many minutes: as long as it takes until the next one is poured."""
POURING = 12
FIRST_POURING = 20
FIRST_TANK = 40
"""Minutes on what is in the tank at the beginning, 50 litres, but for 10 that are left at the end of the shift."""


def generator_instance(refuels: int, parameters: int) -> tuple[str, str, str]:
    """Domain, problem and plan with `refuels` canisters, the first `parameters` of which start at parametrized times.

    The nominal plan pours a canister every 36 minutes; the tank then swings between 30 and 54 of 70 litres.
    All canisters are alike, so only the order of times matters: the i-th pouring (from 1) must start between minutes
    36 i − 32, lest the tank overflow, and 36 i + 14, when the tank is empty. These ranges overlap, and the envelope of
    several starting times is not convex, because either canister may be the earlier one.
    """
    if refuels < 1:
        raise ValueError(f"refuels is {refuels}; expected at least 1")
    if not 0 <= parameters <= refuels:
        raise ValueError(f"parameters is {parameters}; expected 0 to {refuels}, one for each refuel at most")
    canisters = range(1, refuels + 1)
    length = FIRST_TANK + CONTENT * refuels
    problem = _filled(
        "shift.pddl",
        refuels=refuels,
        names=" ".join(f"can{i}" for i in canisters),
        length=length,
        filled="\n".join(
            f"    (sealed can{i}) (= (pour-rate can{i}) 3) (= (pour-time can{i}) {POURING})" for i in canisters
        ),
    )
    starts = [f"start_{i}" if i <= parameters else str(nominal_start(i)) for i in canisters]
    timed = (
        f"c: pour_{i}.start - .zero in [{start}, {start}];\nc: pour_{i}.end - pour_{i}.start in [{POURING}, {POURING}];"
        for i, start in enumerate(starts, 1)
    )
    plan = _filled(
        "shift.stn",
        refuels=refuels,
        parameters=parameters,
        declared="".join(f"parameter start_{i} default {nominal_start(i)};\n" for i in canisters[:parameters]),
        instances="\n".join(f"durative-action instance pour_{i} : (pour gen can{i});" for i in canisters),
        length=length,
        constraints="\n".join(timed),
    )
    return read_text(GENERATING_SET), problem, plan


def nominal_start(refuel: int) -> int:
    """The minute at which the plan starts to pour canister `refuel`, counted from 1."""
    return FIRST_POURING + CONTENT * (refuel - 1)


def _filled(name: str, **values: object) -> str:
    """The file of that name beside this one, with values in the place of their names."""
    return read_text(Path(__file__).with_name(name)).format(**values)


# -- unordered jobs ----------------------------------------------------------------------------------------------------

JOB_MINUTES = 10
JOB_SPARE = 10


def unordered_instance(jobs: int, parameters: int) -> tuple[str, str, str]:
    """Domain, problem and plan of `jobs` jobs, the first `parameters` of which have parametrized durations `d1`, ….

    The envelope: all durations are at least 0, and together at most 10 for each of them and 10 more.
    """
    if jobs < 1:
        raise ValueError(f"jobs is {jobs}; expected at least 1")
    if not 1 <= parameters <= jobs:
        raise ValueError(f"parameters is {parameters}; expected 1 to {jobs}, one for each job at most")
    numbers = range(1, jobs + 1)
    problem = _filled(
        "jobs.pddl",
        jobs=jobs,
        names=" ".join(f"j{i}" for i in numbers),
        energy=envelope_sum(jobs),
        goals=" ".join(f"(done j{i})" for i in numbers),
    )
    durations = [f"d{i}" if i <= parameters else str(JOB_MINUTES) for i in numbers]
    timed = (
        f"c: work_{i}.start - .zero in [1, 100];\nc: work_{i}.end - work_{i}.start in [{duration}, {duration}];\n"
        f"c: watch.end - work_{i}.end in [1, inf];"
        for i, duration in enumerate(durations, 1)
    )
    plan = _filled(
        "jobs.stn",
        declared="".join(f"parameter d{i} default {JOB_MINUTES};\n" for i in numbers[:parameters]),
        instances="\n".join(f"durative-action instance work_{i} : (work j{i});" for i in numbers),
        constraints="\n".join(timed),
    )
    return _filled("battery.pddl"), problem, plan


def time_points(jobs: int) -> int:
    """How many time points are unordered."""
    return 2 * jobs


def envelope_sum(parameters: int) -> int:
    """What the parametrized durations may amount to."""
    return JOB_MINUTES * parameters + JOB_SPARE


# -- files -------------------------------------------------------------------------------------------------------------


def write_instance(directory: Path, refuels: int, parameters: int) -> Files:
    """Write `domain.pddl`, `problem-N.pddl` and `plan-N-K.stn` (N refuels, K parameters) into `directory`."""
    return _write(directory, generator_instance(refuels, parameters), refuels, parameters)


def write_unordered(directory: Path, jobs: int, parameters: int) -> Files:
    """Write `domain.pddl`, `problem-N.pddl` and `plan-N-K.stn` (N jobs, K parameters) into `directory`."""
    return _write(directory, unordered_instance(jobs, parameters), jobs, parameters)


def _write(directory: Path, texts: tuple[str, str, str], size: int, parameters: int) -> Files:
    directory.mkdir(parents=True, exist_ok=True)
    return write_files(directory, texts, ("domain.pddl", f"problem-{size}.pddl", f"plan-{size}-{parameters}.stn"))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.generators.sizes", description=__doc__)
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
