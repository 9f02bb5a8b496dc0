"""Somebody who builds plans with choices: who hands over which part, decided together, whatever the human prefers.

A human fetches a part and mounts it, or asks the robot to fetch it. The robot meanwhile charges, if there is time.
"""

from fractions import Fraction

from robust import pike

DOMAIN = """
(define (domain workshop)
  (:requirements :typing :durative-actions)
  (:types agent)
  (:constants human robot - agent)
  (:predicates (part-here) (charged))
  (:durative-action fetch :parameters (?a - agent) :duration (>= ?duration 0)
    :condition () :effect (at end (part-here)))
  (:durative-action charge :parameters () :duration (>= ?duration 0) :condition () :effect (at end (charged)))
  (:durative-action wait :parameters () :duration (>= ?duration 0) :condition () :effect ())
  (:durative-action mount :parameters () :duration (>= ?duration 0)
    :condition (over all (part-here)) :effect ()))
"""
PROBLEM = "(define (problem shift) (:domain workshop) (:init) (:goal (part-here)))"

fetch = pike.choose(
    "human_does",
    {"fetch": pike.act("(fetch human)", 2, 6, agent="human"), "ask": pike.act("(wait)", 1, 1, agent="human")},
    controllable=False,
)
help_out = pike.choose(
    "robot_does",
    {"fetch": pike.act("(fetch robot)", 3, 4, agent="robot"), "charge": pike.act("(charge)", 4, 9, agent="robot")},
)
shift = pike.within(pike.sequence(pike.parallel(fetch, help_out), pike.act("(mount)", 2, 2, agent="human")), upper=8)
plan = pike.Instance(pike.build("shift", shift), DOMAIN, PROBLEM).plan()

# Which choices are possible, if charging takes so long?
region = pike.region(plan, ["charging=duration:(charge)"], choices=["human_does", "robot_does"])
for minutes in (4, 7):
    print(f"charging takes {minutes}:")
    for choices in sorted(sorted(f"{each.variable} = {each.value}" for each in one)
                          for one in region.possible({"charging": Fraction(minutes)})):  # fmt: skip
        print("  " + ", ".join(choices))

# How long may it take, if the human fetches?
box = pike.envelope(plan, ["charging=duration:(charge)"], assume={"human_does": "fetch", "robot_does": "charge"}).box
print(f"with a human who fetches, charging may take up to {float(box['charging'].upper):g}")

# On the way: the human asks, and the robot knows what to do.
executive = pike.PlanExecutive(plan, pike.make_reasoner("smt"))
if not executive.prepare():
    raise SystemExit("the plan has no correct execution")
executive.step(Fraction(0))
executive.step(Fraction(1, 1000), [pike.Outcome("human_does", "ask")])
print("the human asks, so the robot must:", *executive.possible_values("robot_does"))
