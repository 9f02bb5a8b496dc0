"""Plans of any number of unordered time points, with an envelope that is known by hand.

N jobs may start at any time of the first 100 minutes, in any order. Each drains as much energy as it takes minutes, all
at once when it ends; a watch that lasts through all of them needs energy left. Nothing orders the 2 N starts and ends,
but for each end to be after its start; the envelope is one polyhedron whatever their order is.
"""

from __future__ import annotations

from pathlib import Path

WINDOW = 100
NOMINAL = 10
SPARE = 10
END = 1000

DOMAIN = """\
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
    return DOMAIN, _problem(jobs), _plan(jobs, parameters)


def time_points(jobs: int) -> int:
    """How many time points are unordered."""
    return 2 * jobs


def envelope_sum(parameters: int) -> int:
    """What the parametrized durations may amount to."""
    return NOMINAL * parameters + SPARE


def _problem(jobs: int) -> str:
    names = " ".join(f"j{i}" for i in range(1, jobs + 1))
    goals = " ".join(f"(done j{i})" for i in range(1, jobs + 1))
    return (
        f"(define (problem {jobs}_jobs)\n  (:domain battery)\n  (:objects {names} - job)\n"
        f"  (:init (= (energy) {NOMINAL * jobs + SPARE}))\n  (:goal (and (watched) {goals})))\n"
    )


def _plan(jobs: int, parameters: int) -> str:
    numbers = range(1, jobs + 1)
    lines = [
        *(f"parameter d{i} default {NOMINAL};" for i in range(1, parameters + 1)),
        "durative-action instance watch : (watch);",
        *(f"durative-action instance work_{i} : (work j{i});" for i in numbers),
        "c: watch.start - .zero in [0, 0];",
        f"c: watch.end - watch.start in [{END}, {END}];",
    ]
    for i in numbers:
        duration = f"d{i}" if i <= parameters else str(NOMINAL)
        lines.append(f"c: work_{i}.start - .zero in [1, {WINDOW}];")
        lines.append(f"c: work_{i}.end - work_{i}.start in [{duration}, {duration}];")
        lines.append(f"c: watch.end - work_{i}.end in [1, inf];")
    return "\n".join(lines) + "\n"


def write_unordered(directory: Path, jobs: int, parameters: int) -> tuple[Path, Path, Path]:
    """Write `domain.pddl`, `problem-N.pddl` and `plan-N-K.stn` (N jobs, K parameters) into `directory`."""
    texts = unordered_instance(jobs, parameters)
    directory.mkdir(parents=True, exist_ok=True)
    paths = (directory / "domain.pddl", directory / f"problem-{jobs}.pddl", directory / f"plan-{jobs}-{parameters}.stn")
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text, encoding="utf-8")
    return paths
