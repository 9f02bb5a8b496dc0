"""A researcher: the exact region that CCMMZ asks for, and the boxes of IRR and of this project, for a table.

Run it with `python compare_methods.py DOMAIN PROBLEM PLAN...`; without arguments it takes a plan that is installed.
"""

import csv
import sys
from importlib.resources import files

import robust

rover = files("robust.examples") / "two_sample_navigation"
domain, problem, *plans = sys.argv[1:] or [str(rover / name) for name in ("domain.pddl", "problem.pddl", "plan.stn")]

table = csv.writer(sys.stdout)
table.writerow(["plan", "method", "status", "box", "share of the region's volume", "solver calls"])
for path in plans:
    plan = robust.load_plan(domain, problem, path)
    found = robust.compare(plan, beta=1, timeout=300)
    for entry in found.entries:
        box = entry.result.box
        share = entry.volume_share
        table.writerow([
            path.rsplit("/", 1)[-1],
            entry.method,
            entry.result.status.value,
            " x ".join(f"[{one.lower}, {one.upper}]" for one in box.intervals.values()) if box else "none",
            f"{float(share.lower):.3f}" if share else "unknown",
            entry.result.checks,
        ])  # fmt: skip
