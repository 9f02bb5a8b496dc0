"""Plans of a rover whose battery drains at a rate while it drives, and gains at another while it charges."""

from robust.plan.load import assemble
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.stn import parse_stn

DOMAIN = """(define (domain rover)
  (:requirements :fluents :durative-actions :duration-inequalities)
  (:predicates (idle) (done))
  (:functions (charge) (drain) (gain) (load) (reserve) (capacity) (factor))
  (:durative-action drive
    :duration (>= ?duration 0.01)
    :condition (and (at start (idle)) (over all (>= (charge) (reserve))))
    :effect (and (at start (not (idle))) (at end (idle)) (decrease (charge) (* #t (* (drain) (factor))))))
  (:durative-action recharge
    :duration (>= ?duration 0.01)
    :condition (and (at start (idle)) (over all (<= (charge) (capacity))))
    :effect (and (at start (not (idle))) (at end (idle)) (increase (charge) (* #t (gain)))))
  (:durative-action work
    :duration (>= ?duration 0.01)
    :condition (and (at start (idle)) (at start (>= (charge) (* 2 (reserve)))))
    :effect (and (at start (not (idle))) (at end (idle)) (at end (decrease (charge) (* (load) ?duration)))
      (at end (done))))
  (:durative-action measure
    :duration (= ?duration 1)
    :condition (at start (>= (charge) (reserve)))
    :effect (at end (done))))"""
PROBLEM = """(define (problem p) (:domain rover)
  (:init (idle) (= (charge) {charge}) (= (drain) {drain}) (= (gain) {gain}) (= (load) {load}) (= (reserve) {reserve})
    (= (capacity) {capacity}) (= (factor) 1))
  (:goal (and (done) (>= (charge) {reserve}))))"""


def rover(steps, rates, varied, *, slack=2, charge=60, reserve=5, capacity=100, measured=None):
    """A plan of steps, each an action with its planned duration, in this order.

    Args:
        steps: pairs of action and duration.
        rates: planned values of drain, gain and load.
        varied: the numbers of the steps whose durations are parameters, and the rates that are.
        slack: how long a step may wait for the one before at most.
        measured: when the charge is read beside the steps, if it is.
    """
    values = {"charge": charge, "reserve": reserve, "capacity": capacity, **rates}
    lines, before = [], ".zero"
    for number, (action, duration) in enumerate(steps):
        lines.append(f"durative-action instance s{number} : ({action});")
        if number in varied:
            lines.insert(0, f"parameter d{number} default {duration} lb 0.01;")
        length = f"d{number}" if number in varied else duration
        lines.append(f"c: s{number}.end - s{number}.start in [{length}, {length}];")
        lines.append(f"c: s{number}.start - {before} in [0.001, {slack}];")
        before = f"s{number}.end"
    if measured is not None:
        lines += ["durative-action instance m : (measure);", f"c: m.start - .zero in [{measured}, {measured}];"]
        lines.append("c: m.end - m.start in [1, 1];")
    domain = parse_domain(DOMAIN)
    problem = parse_problem(PROBLEM.format(**values), domain)
    specs = parse_specs([f"fluent:({name}),lb=0" for name in varied if isinstance(name, str)])
    return assemble(domain, problem, parse_stn("\n".join(lines), "plan.stn"), specs)


def random_rover(rng):
    """A plan of 3 to 7 steps with one to three rates and as many durations that vary."""
    steps = [("work", 2)]
    for _ in range(rng.randint(2, 6)):
        action = rng.choice(["drive", "drive", "recharge", "work"])
        steps.insert(rng.randint(0, len(steps)), (action, rng.randint(1, 8)))
    rates = {"drain": rng.randint(1, 4), "gain": rng.randint(2, 6), "load": rng.randint(1, 3)}
    varied = [*rng.sample(["drain", "gain", "load"], rng.randint(1, 3))]
    varied += rng.sample(range(len(steps)), min(len(steps), rng.randint(1, 3)))
    return rover(steps, rates, varied, slack=rng.choice([0.001, 1, 3]))
