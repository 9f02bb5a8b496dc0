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

from ..engine.measure import Files

GENERATING_SET = Path(robust.__file__).parent / "examples" / "generator" / "domain.pddl"

TANK_SIZE = 70
INITIAL_FUEL = 50
BURN_RATE = 1
POUR_RATE = 3
CONTENT = 36
POURING = CONTENT // POUR_RATE
PERIOD = CONTENT // BURN_RATE  # a canister lasts as long as it takes until the next one is poured
FIRST_POURING = 20
SPARE = 10  # litres left in the tank at the end of the shift


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
    return read_text(GENERATING_SET), _shift(refuels), _pourings(refuels, parameters)


def nominal_start(refuel: int) -> int:
    """The minute at which the plan starts to pour canister `refuel`, counted from 1."""
    return FIRST_POURING + PERIOD * (refuel - 1)


def _shift(refuels: int) -> str:
    canisters = range(1, refuels + 1)
    lines = [
        f"; A shift of a generating set that needs {refuels} canisters besides the fuel in its tank.",
        "",
        f"(define (problem shift_with_{refuels}_canisters)",
        "  (:domain generating_set)",
        "",
        "  (:objects",
        "    gen - genset",
        f"    {' '.join(f'can{i}' for i in canisters)} - canister)",
        "",
        "  (:init",
        f"    (= (fuel gen) {INITIAL_FUEL})",
        f"    (= (tank-size gen) {TANK_SIZE})",
        f"    (= (burn-rate gen) {BURN_RATE})",
        f"    (= (shift-length gen) {(INITIAL_FUEL + CONTENT * refuels - SPARE) // BURN_RATE})",
        *(
            f"    (sealed can{i}) (= (pour-rate can{i}) {POUR_RATE}) (= (pour-time can{i}) {POURING})"
            for i in canisters
        ),
        "  )",
        "",
        "  (:goal (shift-done gen)))",
    ]
    return "\n".join(lines) + "\n"


def _pourings(refuels: int, parameters: int) -> str:
    canisters = range(1, refuels + 1)
    length = (INITIAL_FUEL + CONTENT * refuels - SPARE) // BURN_RATE
    starts = {i: f"start_{i}" if i <= parameters else str(nominal_start(i)) for i in canisters}
    lines = [
        f"# {refuels} pourings during one shift; the starting times of the first {parameters} are uncertain.",
        "",
        *(f"parameter start_{i} default {nominal_start(i)};" for i in range(1, parameters + 1)),
        "",
        "durative-action instance shift : (run-shift gen);",
        *(f"durative-action instance pour_{i} : (pour gen can{i});" for i in canisters),
        "",
        "c: shift.start - .zero in [0, 0];",
        f"c: shift.end - shift.start in [{length}, {length}];",
    ]
    for i in canisters:
        lines.append(f"c: pour_{i}.start - .zero in [{starts[i]}, {starts[i]}];")
        lines.append(f"c: pour_{i}.end - pour_{i}.start in [{POURING}, {POURING}];")
    return "\n".join(lines) + "\n"


# -- unordered jobs ----------------------------------------------------------------------------------------------------

JOB_WINDOW = 100
JOB_MINUTES = 10
JOB_SPARE = 10
WATCH = 1000

BATTERY = """\
; Jobs that drain a battery by as much as they take time.

(define (domain battery)
  (:requirements :typing :durative-actions :numeric-fluents :duration-inequalities)

  (:types job)

  (:predicates (done ?j - job) (watched))

  (:functions (energy))

  (:durative-action watch
    :parameters ()
    :duration (>= ?duration 0)
    :condition (over all (>= (energy) 0))
    :effect (at end (watched)))

  (:durative-action work
    :parameters (?j - job)
    :duration (>= ?duration 0)
    :condition (and)
    :effect (and (at end (decrease (energy) ?duration)) (at end (done ?j)))))
"""


def unordered_instance(jobs: int, parameters: int) -> tuple[str, str, str]:
    """Domain, problem and plan of `jobs` jobs, the first `parameters` of which have parametrized durations `d1`, ….

    The envelope: all durations are at least 0, and together at most 10 for each of them and 10 more.
    """
    if jobs < 1:
        raise ValueError(f"jobs is {jobs}; expected at least 1")
    if not 1 <= parameters <= jobs:
        raise ValueError(f"parameters is {parameters}; expected 1 to {jobs}, one for each job at most")
    return BATTERY, _jobs_problem(jobs), _jobs_plan(jobs, parameters)


def time_points(jobs: int) -> int:
    """How many time points are unordered."""
    return 2 * jobs


def envelope_sum(parameters: int) -> int:
    """What the parametrized durations may amount to."""
    return JOB_MINUTES * parameters + JOB_SPARE


def _jobs_problem(jobs: int) -> str:
    names = " ".join(f"j{i}" for i in range(1, jobs + 1))
    goals = " ".join(f"(done j{i})" for i in range(1, jobs + 1))
    return (
        f"(define (problem {jobs}_jobs)\n  (:domain battery)\n  (:objects {names} - job)\n"
        f"  (:init (= (energy) {JOB_MINUTES * jobs + JOB_SPARE}))\n  (:goal (and (watched) {goals})))\n"
    )


def _jobs_plan(jobs: int, parameters: int) -> str:
    numbers = range(1, jobs + 1)
    lines = [
        *(f"parameter d{i} default {JOB_MINUTES};" for i in range(1, parameters + 1)),
        "durative-action instance watch : (watch);",
        *(f"durative-action instance work_{i} : (work j{i});" for i in numbers),
        "c: watch.start - .zero in [0, 0];",
        f"c: watch.end - watch.start in [{WATCH}, {WATCH}];",
    ]
    for i in numbers:
        duration = f"d{i}" if i <= parameters else str(JOB_MINUTES)
        lines.append(f"c: work_{i}.start - .zero in [1, {JOB_WINDOW}];")
        lines.append(f"c: work_{i}.end - work_{i}.start in [{duration}, {duration}];")
        lines.append(f"c: watch.end - work_{i}.end in [1, inf];")
    return "\n".join(lines) + "\n"


# -- files -------------------------------------------------------------------------------------------------------------


def write_instance(directory: Path, refuels: int, parameters: int) -> Files:
    """Write `domain.pddl`, `problem-N.pddl` and `plan-N-K.stn` (N refuels, K parameters) into `directory`."""
    return _write(directory, generator_instance(refuels, parameters), refuels, parameters)


def write_unordered(directory: Path, jobs: int, parameters: int) -> Files:
    """Write `domain.pddl`, `problem-N.pddl` and `plan-N-K.stn` (N jobs, K parameters) into `directory`."""
    return _write(directory, unordered_instance(jobs, parameters), jobs, parameters)


def _write(directory: Path, texts: tuple[str, str, str], size: int, parameters: int) -> Files:
    directory.mkdir(parents=True, exist_ok=True)
    names = ("domain.pddl", f"problem-{size}.pddl", f"plan-{size}-{parameters}.stn")
    domain, problem, plan = (directory / name for name in names)
    for path, text in zip((domain, problem, plan), texts, strict=True):
        path.write_text(text, encoding="utf-8")
    return domain, problem, plan


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
