"""Job shops as a planner prints them: parts are cut, painted and packed by two workers, with one saw and one booth.

The domain is that of the shipped example `workshop`; every action starts as soon as its part, a worker and its machine
are free.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from random import Random

from robust import examples
from robust.encode.interface import EPSILON

DOMAIN = Path(examples.__file__).parent / "workshop" / "domain.pddl"
WORKERS = ("ann", "bob")
ACTIONS = (("saw", "cutting", "saw"), ("paint", "painting", "booth"), ("pack", "packing", ""))
"""What is done with each part, the function of its duration, and the machine it takes."""


def shop_files(parts: int, seed: int, folder: Path) -> tuple[Path, Path, Path]:
    """Domain, problem and printed plan of so many parts, the last two written into that folder."""
    random = Random(seed)  # noqa: S311 - not for secrets
    names = [f"p{number}" for number in range(parts)]
    lengths = {(name, action): random.randint(4, 30) for name in names for action, _, _ in ACTIONS}
    values = " ".join(
        f"(= ({function} {name}) {lengths[name, action]})" for name in names for action, function, _ in ACTIONS
    )
    problem = folder / "problem.pddl"
    problem.write_text(
        f"(define (problem shop) (:domain workshop) (:objects {' '.join(WORKERS)} - worker {' '.join(names)} - part)"
        f" (:init (free ann) (free bob) (saw) (booth) {' '.join(f'(raw {name})' for name in names)} {values})"
        f" (:goal (and {' '.join(f'(packed {name})' for name in names)})))\n",
        encoding="utf-8",
    )
    plan = folder / "plan.log"
    plan.write_text("".join(_schedule(random, names, lengths)), encoding="utf-8")
    return DOMAIN, problem, plan


def _schedule(random: Random, names: list[str], lengths: dict[tuple[str, str], int]) -> list[str]:
    free: dict[str, Fraction] = {}
    left = {name: list(ACTIONS) for name in names}
    lines = []
    while left:
        starts = {}
        for name, (step, *_) in left.items():
            worker = min(WORKERS, key=lambda one: free.get(one, Fraction(0)))
            taken = [one for one in (name, worker, step[2]) if one]
            starts[name] = max(free.get(one, Fraction(0)) for one in taken), taken
        name = min(starts, key=lambda one: (starts[one][0], random.random()))
        (action, _, _), taken = left[name].pop(0), starts[name][1]
        start = starts[name][0] + EPSILON
        for one in taken:
            free[one] = start + lengths[name, action]
        lines.append(f"{float(start):.3f}: ({action} {taken[1]} {name}) [{lengths[name, action]}]\n")
        if not left[name]:
            del left[name]
    return lines
