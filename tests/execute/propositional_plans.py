"""What planners print for domains without numeric fluents: constant durations; see planner_plans.py."""

from collections.abc import Mapping
from typing import NamedTuple


class Printed(NamedTuple):
    """A domain, a problem and the output of a planner; `steps` is how many of its last plan there are."""

    domain: str
    problem: str
    log: str
    steps: int
    val: bool = True
    """Whether VAL reads it."""


def named(found: Mapping[str, object]) -> dict[str, Printed]:
    """The plans of a module, by the domain that they are like."""
    plans = ((name, each) for name, each in found.items() if isinstance(each, Printed))
    return {name.lower().replace("_", " "): each for name, each in plans}


CREW = Printed(
    """
(define (domain CrewPlanning)
  (:requirements :typing :durative-actions)
  (:types crewmember medicalstate - object day - object)
  (:predicates (available ?c - CrewMember) (currentday ?c - crewmember ?d - day) (next ?d1 ?d2 - day)
    (done_meal ?c - crewmember ?d - day) (done_sleep ?c - crewmember ?d - day) (done_exercise ?c - CREWMEMBER ?d - day))
  (:durative-action post_sleep :parameters (?c - CrewMember ?d1 ?d2 - day) :duration (= ?duration 195)
    :condition (and (at start (done_sleep ?c ?d1)) (at start (currentday ?c ?d1)) (over all (next ?d1 ?d2)))
    :effect (and (at start (not (currentday ?c ?d1))) (at end (currentday ?c ?d2)) (at end (available ?c))))
  (:durative-action have_meal :parameters (?c - crewmember ?d - day) :duration (= ?duration 60)
    :condition (and (at start (available ?c)) (over all (currentday ?c ?d)))
    :effect (and (at start (not (available ?c))) (at end (available ?c)) (at end (done_meal ?c ?d))))
  (:durative-action exercise :parameters (?c - crewmember ?d - day) :duration (= ?duration 60)
    :condition (and (at start (available ?c)) (over all (done_meal ?c ?d)))
    :effect (and (at start (not (available ?c))) (at end (available ?c)) (at end (done_exercise ?c ?d)))))
""",
    """
(define (problem CrewPlanning_1)
  (:domain crewplanning)
  (:objects c1 c2 - CrewMember d1 d2 - day)
  (:init (currentday c1 d1) (currentday C2 d1) (done_sleep c1 d1) (done_sleep c2 d1) (next d1 d2))
  (:goal (and (done_exercise c1 d2) (done_meal c2 d2)))
  (:metric minimize (total-time)))
""",
    """Number of literals: 14
Constructing lookup tables: [10%] [20%] [30%]
b (8.000 | 195.001)b (7.000 | 195.001)
;;;; Solution Found
; States evaluated: 12
; Cost: 315.003
; Time 0.04
0.000: (post_sleep c1 d1 d2)  [195.000]
0.000: (post_sleep c2 d1 d2)  [195.000]
195.001: (have_meal c1 d2)  [60.000]
195.001: (have_meal c2 d2)  [60.000]
255.002: (exercise c1 d2)  [60.000]
""",
    5,
)

MATCH_CELLAR = Printed(
    """
(define (domain matchcellar)
  (:requirements :typing :durative-actions)
  (:types match fuse)
  (:predicates (handfree) (unused ?match - match) (mended ?fuse - fuse) (light ?match - match))
  (:durative-action LIGHT_MATCH :parameters (?match - match) :duration (= ?duration 8)
    :condition (and (at start (unused ?match)) (over all (light ?match)))
    :effect (and (at start (not (unused ?match))) (at start (light ?match)) (at end (not (light ?match)))))
  (:durative-action MEND_FUSE :parameters (?fuse - fuse ?match - match) :duration (= ?duration 3)
    :condition (and (at start (handfree)) (over all (light ?match)))
    :effect (and (at start (not (handfree))) (at end (mended ?fuse)) (at end (handfree)))))
""",
    """
(define (problem fixfuse) (:domain matchcellar)
  (:objects match0 - match fuse0 fuse1 - fuse)
  (:init (handfree) (unused match0))
  (:goal (and (mended fuse0) (mended fuse1)))
  (:metric minimize (total-time)))
""",
    """
; Plan found with metric 8.000
; Theoretical reachable cost 8.000
; States evaluated so far: 7
; Time 0.00
0.000: (light_match match0)  [8.000]
0.001: (mend_fuse fuse0 match0)  [3.000]
3.002: (mend_fuse fuse1 match0)  [3.000]

 * All goal deadlines now no later than 8.000

b (0.000 | 8.000)
""",
    3,
)

SOKOBAN = Printed(
    """
(define (domain sokoban-temporal)
  (:requirements :typing :durative-actions)
  (:types thing location direction - object player stone - thing)
  (:predicates (clear ?l - location) (at ?t - thing ?l - location) (at-goal ?s - stone) (IS-GOAL ?l - location)
    (IS-NONGOAL ?l - location) (MOVE-DIR ?from ?to - location ?dir - direction))
  (:durative-action move :parameters (?p - player ?from ?to - location ?dir - direction) :duration (= ?duration 1)
    :condition (and (at start (at ?p ?from)) (at start (clear ?to)) (over all (MOVE-DIR ?from ?to ?dir)))
    :effect (and (at start (not (at ?p ?from))) (at end (at ?p ?to)) (at start (not (clear ?to)))
      (at end (clear ?from))))
  (:durative-action push-to-goal :parameters (?p - player ?s - stone ?ppos ?from ?to - location ?dir - direction)
    :duration (= ?duration 1)
    :condition (and (at start (at ?p ?ppos)) (at start (at ?s ?from)) (at start (clear ?to))
      (over all (MOVE-DIR ?ppos ?from ?dir)) (over all (MOVE-DIR ?from ?to ?dir)) (over all (IS-GOAL ?to)))
    :effect (and (at start (not (at ?p ?ppos))) (at start (not (at ?s ?from))) (at start (not (clear ?to)))
      (at end (at ?p ?from)) (at end (at ?s ?to)) (at end (clear ?ppos)) (at end (at-goal ?s)))))
""",
    """
(define (problem p01-small) (:domain Sokoban-Temporal)
  (:objects dir-right - direction player-01 - player stone-01 - stone pos-1-1 pos-2-1 pos-3-1 pos-4-1 - location)
  (:init (IS-GOAL pos-4-1) (IS-NONGOAL pos-1-1) (IS-NONGOAL pos-2-1) (IS-NONGOAL pos-3-1)
    (MOVE-DIR pos-1-1 pos-2-1 dir-right) (MOVE-DIR pos-2-1 pos-3-1 dir-right) (MOVE-DIR pos-3-1 pos-4-1 dir-right)
    (at player-01 pos-1-1) (at stone-01 pos-3-1) (clear pos-2-1) (clear pos-4-1))
  (:goal (at-goal stone-01)))
""",
    """; Version LPG-td-1.0
; Seed 2004
; Command line: ./lpg-td -o domain.pddl -f problem.pddl -n 1
; Problem p01-small
; Time 0.01
; Search time 0.00
; Parsing time 0.01
; Mutex time 0.00
; MetricValue 2.00

0.0003:   (MOVE PLAYER-01 POS-1-1 POS-2-1 DIR-RIGHT) [D:1.0000; C:0.1000]
1.0013:   (PUSH-TO-GOAL PLAYER-01 STONE-01 POS-2-1 POS-3-1 POS-4-1 DIR-RIGHT) [D:1.0000; C:0.1000]
""",
    2,
)

TMS = Printed(
    """
(define (domain domain-tms-2-3)
 (:requirements :typing :durative-actions)
 (:types piece1 piece2 - piece kiln8 kiln20 - kiln)
 (:predicates (energy) (ready ?k - kiln) (baking ?p - piece) (treated ?p - piece) (baked ?p - piece)
   (structured ?p1 - piece ?p2 - piece) (baked-structure ?p1 - piece ?p2 - piece))
 (:durative-action fire-kiln1 :parameters (?k - kiln8) :duration (= ?duration 8) :condition (over all (energy))
   :effect (and (at start (ready ?k)) (at end (not (ready ?k)))))
 (:durative-action bake-ceramic1 :parameters (?p - piece1 ?k - kiln) :duration (= ?duration 5)
   :condition (and (over all (ready ?k)))
   :effect (and (at start (baking ?p)) (at end (not (baking ?p))) (at end (baked ?p))))
 (:durative-action treat-ceramic1 :parameters (?p - piece) :duration (= ?duration 3)
   :condition (and (over all (baking ?p)))
   :effect (at end (treated ?p))))
""",
    """
(define (problem pfile1) (:domain domain-tms-2-3)
 (:objects kiln0 - kiln8 p0 - piece1)
 (:init (energy))
 (:goal (and (baked p0) (treated p0))))
""",
    """[0.014s] Parsed problem
[0.025s] Solution found
**** Plan ****
0: (fire-kiln1 kiln0) [8]
0.001: (bake-ceramic1 p0 kiln0) [5]
0.002: (treat-ceramic1 p0) [3]
""",
    3,
)

FLOOR_TILE = Printed(
    """
(define (domain floor-tile)
(:requirements :typing :durative-actions)
(:types robot tile color - object)
(:predicates (robot-at ?r - robot ?x - tile) (up ?x - tile ?y - tile) (down ?x - tile ?y - tile) (clear ?x - tile)
  (painted ?x - tile ?c - color) (robot-has ?r - robot ?c - color) (available-color ?c - color))
(:durative-action change-color :parameters (?r - robot ?c - color ?c2 - color) :duration (= ?duration 5)
  :condition (and (at start (robot-has ?r ?c)) (over all (available-color ?c2)))
  :effect (and (at start (not (robot-has ?r ?c))) (at end (robot-has ?r ?c2))))
(:durative-action paint-up :parameters (?r - robot ?y - tile ?x - tile ?c - color) :duration (= ?duration 2)
  :condition (and (over all (robot-has ?r ?c)) (at start (robot-at ?r ?x)) (over all (up ?y ?x)) (at start (clear ?y)))
  :effect (and (at start (not (clear ?y))) (at end (painted ?y ?c))))
(:durative-action down :parameters (?r - robot ?x - tile ?y - tile) :duration (= ?duration 1)
  :condition (and (at start (robot-at ?r ?x)) (over all (down ?y ?x)) (at start (clear ?y)))
  :effect (and (at start (not (robot-at ?r ?x))) (at end (robot-at ?r ?y)) (at start (not (clear ?y)))
    (at end (clear ?x)))))
""",
    """
(define (problem p01) (:domain floor-tile)
 (:objects tile_0-1 tile_1-1 tile_2-1 - tile robot1 - robot white black - color)
 (:init (robot-at robot1 tile_1-1) (robot-has robot1 white) (available-color white) (available-color black)
   (clear tile_2-1) (clear tile_0-1) (up tile_2-1 tile_1-1) (up tile_1-1 tile_0-1) (down tile_1-1 tile_2-1)
   (down tile_0-1 tile_1-1))
 (:goal (and (painted tile_2-1 white) (painted tile_1-1 black)))
 (:metric minimize (total-time)))
""",
    """status: SOLVED_SATISFICING
engine: aries
plan: TimeTriggeredPlan:
    0.0: paint-up(robot1, tile_2-1, tile_1-1, white) [2.0]
    2.01: down(robot1, tile_1-1, tile_0-1) [1.0]
    2.01: change-color(robot1, white, black) [5.0]
    7.02: paint-up(robot1, tile_1-1, tile_0-1, black) [2.0]
""",
    4,
)

UNTYPED = Printed(
    """
(DEFINE (DOMAIN GRIPPER-TEMPORAL)
  (:REQUIREMENTS :STRIPS :DURATIVE-ACTIONS)
  (:PREDICATES (ROOM ?R) (BALL ?B) (GRIPPER ?G) (AT-ROBBY ?R) (AT ?B ?R) (FREE ?G) (CARRY ?O ?G) (CALLED))
  (:DURATIVE-ACTION MOVE :PARAMETERS (?FROM ?TO) :DURATION (= ?DURATION 2)
    :CONDITION (AND (AT START (ROOM ?FROM)) (AT START (ROOM ?TO)) (AT START (AT-ROBBY ?FROM)))
    :EFFECT (AND (AT START (NOT (AT-ROBBY ?FROM))) (AT END (AT-ROBBY ?TO))))
  (:ACTION PICK :PARAMETERS (?OBJ ?ROOM ?GRIPPER)
    :PRECONDITION (AND (BALL ?OBJ) (ROOM ?ROOM) (GRIPPER ?GRIPPER) (AT ?OBJ ?ROOM) (AT-ROBBY ?ROOM) (FREE ?GRIPPER))
    :EFFECT (AND (CARRY ?OBJ ?GRIPPER) (NOT (AT ?OBJ ?ROOM)) (NOT (FREE ?GRIPPER))))
  (:DURATIVE-ACTION WAIT :PARAMETERS () :DURATION (= ?DURATION 0.5) :CONDITION (AND) :EFFECT (AND))
  (:ACTION SHOUT :PARAMETERS () :PRECONDITION () :EFFECT (CALLED)))
""",
    """
(define (problem strips-gripper-x-1) (:domain gripper-temporal)
  (:objects rooma roomb ball1 left)
  (:init (room rooma) (room roomb) (ball ball1) (at-robby rooma) (free left) (at ball1 roomb) (gripper left))
  (:goal (carry ball1 left)))
""",
    """TimeTriggeredPlan:
    0.0: move(rooma, roomb) [2.0]
    0.1: wait [0.5]
    1.0: shout
    2.01: pick(ball1, roomb, left)
""",
    4,
)

PROPOSITIONAL = named(globals())
