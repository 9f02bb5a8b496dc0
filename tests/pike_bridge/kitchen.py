"""A kitchen to test with: a human takes a mug or a glass and makes food, and a robot pours into what was taken."""

from robust.pike_bridge import builder
from robust.pike_bridge.builder import act, choose, parallel, sequence

DOMAIN = """
(define (domain kitchen)
  (:requirements :typing :durative-actions :negative-preconditions)
  (:types agent vessel food - object)
  (:predicates (reachable ?v - vessel) (taken ?v - vessel) (filled ?v - vessel) (closed)
               (made ?f - food) (edible ?f - food))
  (:durative-action get :parameters (?a - agent ?v - vessel)
    :duration (and (>= ?duration 0.1) (<= ?duration 10))
    :condition (and (at start (reachable ?v)) (at start (not (filled ?v))))
    :effect (and (at start (not (reachable ?v))) (at end (taken ?v))))
  (:durative-action pour :parameters (?a - agent ?v - vessel)
    :duration (>= ?duration 0)
    :condition (over all (taken ?v))
    :effect (at end (filled ?v)))
  (:durative-action make :parameters (?a - agent ?f - food)
    :duration (>= ?duration 0)
    :condition (and (at start (edible ?f)) (at end (not (closed))))
    :effect (at end (made ?f))))
"""

PROBLEM = """
(define (problem breakfast) (:domain kitchen)
  (:objects human robot - agent mug glass - vessel bagel cereal - food)
  (:init (reachable mug) (reachable glass) (edible bagel) (edible cereal))
  (:goal (and (filled mug) (made bagel))))
"""


def kitchen():
    taking = {vessel: act(f"(get human {vessel})", "0.5", 2, agent="human") for vessel in ("mug", "glass")}
    pouring = {vessel: act(f"(pour robot {vessel})", 1, 3, agent="robot") for vessel in ("mug", "glass")}
    making = {food: act(f"(make human {food})", 2, 4, agent="human") for food in ("bagel", "cereal")}
    return builder.build(
        "kitchen",
        sequence(
            choose("xA1", taking, controllable=False),
            parallel(choose("xR1", pouring), choose("xA2", making, controllable=False)),
        ),
    )
