"""Instances of the generating-set domain in any size, for scaling studies."""

from __future__ import annotations

from pathlib import Path

from robust.plan.pddl.forms import read_text

DOMAIN = Path(__file__).parents[1] / "examples" / "generator" / "domain.pddl"

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
    return read_text(DOMAIN), _problem(refuels), _plan(refuels, parameters)


def nominal_start(refuel: int) -> int:
    """The minute at which the plan starts to pour canister `refuel`, counted from 1."""
    return FIRST_POURING + PERIOD * (refuel - 1)


def _problem(refuels: int) -> str:
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


def _plan(refuels: int, parameters: int) -> str:
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


def write_instance(directory: Path, refuels: int, parameters: int) -> tuple[Path, Path, Path]:
    """Write `domain.pddl`, `problem-N.pddl` and `plan-N-K.stn` (N refuels, K parameters) into `directory`."""
    texts = generator_instance(refuels, parameters)
    directory.mkdir(parents=True, exist_ok=True)
    domain = directory / "domain.pddl"
    problem = directory / f"problem-{refuels}.pddl"
    plan = directory / f"plan-{refuels}-{parameters}.stn"
    for path, text in zip((domain, problem, plan), texts, strict=True):
        path.write_text(text, encoding="utf-8")
    return domain, problem, plan
