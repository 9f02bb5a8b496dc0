"""An engineer: a planner's log becomes a proved interval for each move, which the robot's executor watches.

Run it with `python planner_to_robot.py DOMAIN PROBLEM LOG ACTION`; without arguments it takes a plan that is installed.
"""

import sys
from fractions import Fraction
from importlib.resources import files

import robust

rover = files("robust.examples") / "two_sample_navigation"
installed = [*(str(rover / name) for name in ("domain.pddl", "problem.pddl", "steps.plan")), "drive"]
domain, problem, log, action = sys.argv[1:] or installed

# Before the robot moves: is the plan right as printed, and how far may the durations deviate?
verdict = robust.validate(domain, problem, log)
if not verdict.valid:
    sys.exit(f"the plan is invalid: {verdict}")
plan = robust.load_plan(domain, problem, log, parameters=[f"duration:{action}"])
result = robust.envelope(plan, timeout=30)
if not result.verified:
    sys.exit(f"nothing is proved: {result.status.value}")
box = result.box
for name, interval in box.intervals.items():
    print(f"{name}: {float(interval.lower):g} to {float(interval.upper):g} minutes")

# While it moves: each duration that was measured is held against its interval; outside of it, plan anew.
measured = {"dur_n0": "31.25", "dur_n2": "46.5"}
nominal = {parameter.name: parameter.nominal for parameter in plan.parameters}
for name, minutes in measured.items():
    nominal[name] = Fraction(minutes)
    inside = nominal in box
    print(f"{name} took {minutes} minutes:", "go on" if inside else "outside of the box, stop and plan anew")
    if not inside:
        break
