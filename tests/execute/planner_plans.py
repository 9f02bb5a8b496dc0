"""Domains, problems and plans with the constructs of the temporal competitions, in every layout of planners.

Each plan is valid, and what its planner printed of it may be rounded. The texts are small, but have what the domains
after which they are named have. Those here have numeric fluents.
"""

from tests.execute.propositional_plans import PROPOSITIONAL, Printed, named

ELEVATORS = Printed(
    """
(define (domain elevators-time)
(:requirements :typing :numeric-fluents :durative-actions)
(:types elevator - object slow-elevator fast-elevator - elevator passenger - object count - object)
(:predicates (passenger-at ?person - passenger ?floor - count) (boarded ?person - passenger ?lift - elevator)
  (lift-at ?lift - elevator ?floor - count) (reachable-floor ?lift - elevator ?floor - count)
  (above ?floor1 - count ?floor2 - count) (can-hold ?lift - elevator ?n - count)
  (passengers ?lift - elevator ?n - count) (next ?n1 - count ?n2 - count))
(:functions (travel-slow ?f1 - count ?f2 - count) - number (travel-fast ?f1 - count ?f2 - count) - number)
(:durative-action move-up-slow
  :parameters (?lift - slow-elevator ?f1 - count ?f2 - count)
  :duration (= ?duration (travel-slow ?f1 ?f2))
  :condition (and (at start (lift-at ?lift ?f1)) (at start (above ?f1 ?f2)) (at start (reachable-floor ?lift ?f2)))
  :effect (and (at end (lift-at ?lift ?f2)) (at start (not (lift-at ?lift ?f1)))))
(:durative-action board
  :parameters (?p - passenger ?lift - elevator ?f - count ?n1 - count ?n2 - count)
  :duration (= ?duration 1)
  :condition (and (over all (lift-at ?lift ?f)) (at start (passenger-at ?p ?f)) (at start (passengers ?lift ?n1))
    (at start (next ?n1 ?n2)) (at start (can-hold ?lift ?n2)))
  :effect (and (at start (not (passenger-at ?p ?f))) (at end (boarded ?p ?lift))
    (at start (not (passengers ?lift ?n1))) (at end (passengers ?lift ?n2))))
(:durative-action leave
  :parameters (?p - passenger ?lift - elevator ?f - count ?n1 - count ?n2 - count)
  :duration (= ?duration 1)
  :condition (and (over all (lift-at ?lift ?f)) (at start (boarded ?p ?lift)) (at start (passengers ?lift ?n1))
    (at start (next ?n2 ?n1)))
  :effect (and (at end (passenger-at ?p ?f)) (at start (not (boarded ?p ?lift)))
    (at start (not (passengers ?lift ?n1))) (at end (passengers ?lift ?n2)))))
""",
    """
(define (problem elevators-time-p1) (:domain elevators-time)
(:objects n0 n1 n2 - count p0 - passenger slow0-0 - slow-elevator)
(:init (next n0 n1) (next n1 n2) (above n0 n1) (above n0 n2) (above n1 n2) (lift-at slow0-0 n0)
  (passengers slow0-0 n0) (can-hold slow0-0 n1) (reachable-floor slow0-0 n0) (reachable-floor slow0-0 n2)
  (passenger-at p0 n0) (= (travel-slow n0 n1) 12) (= (travel-slow n0 n2) 20) (= (travel-slow n1 n2) 12))
(:goal (and (passenger-at p0 n2)))
(:metric minimize (total-time)))
""",
    """Solution found!
0.00100000: (board p0 slow0-0 n0 n0 n1) [1.00000000]
1.01100000: (move-up-slow slow0-0 n0 n2) [20.00000000]
21.02100000: (leave p0 slow0-0 n2 n1 n0) [1.00000000]
Rescheduled Plan:
0.00000000: (board p0 slow0-0 n0 n0 n1) [1.00000000]
1.00100000: (move-up-slow slow0-0 n0 n2) [20.00000000]
21.00200000: (leave p0 slow0-0 n2 n1 n0) [1.00000000]
Makespan    : 22
Plan length: 3 step(s).
""",
    3,
)

DRIVERLOG = Printed(
    """
(define (domain driverlogshift)
  (:requirements :typing :durative-actions :fluents :timed-initial-literals :negative-preconditions)
  (:types location locatable - object driver truck obj - locatable)
  (:predicates (at ?obj - locatable ?loc - location) (in ?obj1 - obj ?obj - truck) (driving ?d - driver ?v - truck)
    (link ?x ?y - location) (empty ?v - truck) (working ?d - driver) (rested ?d - driver))
  (:functions (time-to-drive ?loc ?loc1 - location) (driven) (walked ?d - driver))
  (:durative-action LOAD-TRUCK :parameters (?obj - obj ?truck - truck ?loc - location) :duration (= ?duration 2)
    :condition (and (over all (at ?truck ?loc)) (at start (at ?obj ?loc)))
    :effect (and (at start (not (at ?obj ?loc))) (at end (in ?obj ?truck))))
  (:durative-action BOARD-TRUCK :parameters (?driver - driver ?truck - truck ?loc - location) :duration (= ?duration 1)
    :condition (and (over all (at ?truck ?loc)) (at start (at ?driver ?loc)) (at start (empty ?truck))
      (over all (working ?driver)))
    :effect (and (at start (not (at ?driver ?loc))) (at end (driving ?driver ?truck)) (at start (not (empty ?truck)))))
  (:durative-action DRIVE-TRUCK :parameters (?truck - truck ?from ?to - location ?driver - driver)
    :duration (= ?duration (time-to-drive ?from ?to))
    :condition (and (at start (at ?truck ?from)) (over all (driving ?driver ?truck)) (at start (link ?from ?to))
      (over all (working ?driver)))
    :effect (and (at start (not (at ?truck ?from))) (at end (at ?truck ?to))
      (at end (increase (driven) (time-to-drive ?from ?to)))))
  (:durative-action REST :parameters (?driver - driver) :duration (= ?duration 4)
    :condition (and (at start (not (working ?driver))) (over all (not (working ?driver))))
    :effect (and (at end (rested ?driver)))))
""",
    """
(define (problem DLOG-1-1) (:domain driverlogshift)
  (:objects driver1 - driver truck1 - truck package1 - obj s0 s1 - location)
  (:init (at driver1 s0) (at truck1 s0) (empty truck1) (at package1 s0) (link s0 s1) (link s1 s0) (working driver1)
    (= (time-to-drive s0 s1) 6.5) (= (time-to-drive s1 s0) 6.5) (= (driven) 0) (at 20 (not (working driver1))))
  (:goal (and (in package1 truck1) (at truck1 s1) (rested driver1) (<= (driven) 10)))
  (:metric minimize (+ (* 2 (total-time)) (* 1 (driven)))))
""",
    """[INFO] [1623412312.123456789] [planner]: Planner found:
[terminal-1] [INFO] [1623412312.1] [executor]: 0:\t(LOAD-TRUCK PACKAGE1 TRUCK1 S0)\t[2]
[terminal-1] [INFO] [1623412312.1] [executor]: 0.5:\t(board-truck driver1 truck1 s0)\t[1]
[terminal-1] [INFO] [1623412312.1] [executor]: 2.001:\t(drive-truck truck1 s0 s1 driver1)\t[6.5]
[terminal-1] [INFO] [1623412312.1] [executor]: 20.001:\t(rest driver1)\t[4]
""",
    4,
)

ROADS = Printed(
    """
(define (domain rtam)
  (:requirements :typing :durative-actions :fluents :negative-preconditions :equality)
  (:types accident_location assets - subject vehicle - assets
    police_car tow_truck ambulance - vehicle accident_victim car - object_of_interest)
  (:constants police_station - accident_location)
  (:predicates (at ?x - (either vehicle accident_victim car) ?l - accident_location) (busy ?v - vehicle)
    (certified ?x - (either accident_victim car))
    (untrapped ?p - accident_victim) (delivered ?x - (either accident_victim car))
    (loaded ?x - (either car accident_victim)
      ?v - (either ambulance tow_truck)) (road ?a ?b - accident_location))
  (:functions (distance ?a ?b - accident_location) (speed ?v - vehicle))
  (:durative-action drive :parameters (?v - vehicle ?a ?b - accident_location)
    :duration (= ?duration (/ (distance ?a ?b) (speed ?v)))
    :condition (and (at start (at ?v ?a)) (at start (not (= ?a ?b))) (over all (road ?a ?b)) (at start (not (busy ?v))))
    :effect (and (at start (not (at ?v ?a))) (at end (at ?v ?b))))
  (:durative-action certify :parameters (?c - police_car ?x - (either accident_victim car) ?l - accident_location)
    :duration (= ?duration 4)
    :condition (and (at start (at ?c ?l)) (over all (at ?c ?l)) (at start (at ?x ?l)) (at start (not (busy ?c))))
    :effect (and (at start (busy ?c)) (at end (not (busy ?c))) (at end (certified ?x))))
  (:durative-action tow :parameters (?t - (either tow_truck ambulance) ?x - (either accident_victim car)
      ?l - accident_location)
    :duration (= ?duration 2)
    :condition (and (over all (at ?t ?l)) (at start (at ?x ?l)) (over all (certified ?x)))
    :effect (and (at start (not (at ?x ?l))) (at end (loaded ?x ?t)))))
""",
    """
(define (problem crash) (:domain RTAM)
  (:objects p1 - police_car t1 - tow_truck c1 - car place1 - accident_location)
  (:init (at p1 police_station) (at t1 police_station) (at c1 place1) (road police_station place1)
    (= (distance police_station place1) 100) (= (speed p1) 70) (= (speed t1) 60))
  (:goal (loaded c1 t1)))
""",
    """0.00000000: (drive p1 police_station place1) [1.42857000]
0.00000000: (drive t1 police_station place1) [1.66667000]
1.43957000: (certify p1 c1 place1) [4.00000000]
5.44957000: (tow t1 c1 place1) [2.00000000]
""",
    4,
)

PIPESWORLD = Printed(
    """
; deadlines as windows
(define (domain pipesworld_strips_deadlines)
 (:requirements :strips :typing :durative-actions :fluents :timed-initial-literals)
 (:types pipe area product batch-atom)
 (:constants lco gasoleo - product)
 (:predicates (on ?batch-atom - batch-atom ?area - area) (first ?batch-atom - batch-atom ?pipe - pipe)
   (connect ?from ?to - area ?pipe - pipe) (is-product ?batch-atom - batch-atom ?product - product)
   (may-interface ?product-a ?product-b - product) (normal ?pipe - pipe) (not-timed-out ?b - batch-atom)
   (deliverable ?batch-atom - batch-atom ?product - product ?area - area) (delivered ?batch-atom - batch-atom))
 (:functions (speed ?pipe - pipe))
 (:durative-action PUSH-UNITARYPIPE
   :parameters (?pipe - pipe ?batch-atom-in ?batch-atom-out - batch-atom ?from-area ?to-area - area
     ?product-in ?product-out - product)
   :duration (= ?duration (/ 2 (speed ?pipe)))
   :condition (and (over all (normal ?pipe)) (at start (first ?batch-atom-out ?pipe))
     (over all (connect ?from-area ?to-area ?pipe)) (at start (on ?batch-atom-in ?from-area))
     (over all (is-product ?batch-atom-in ?product-in)) (over all (is-product ?batch-atom-out ?product-out))
     (over all (may-interface ?product-in ?product-out)))
   :effect (and (at start (not (first ?batch-atom-out ?pipe))) (at end (first ?batch-atom-in ?pipe))
     (at start (not (on ?batch-atom-in ?from-area))) (at end (on ?batch-atom-out ?to-area))))
 (:action DELIVER :parameters (?b - batch-atom ?p - product ?a - area)
   :precondition (and (on ?b ?a) (is-product ?b ?p) (deliverable ?b ?p ?a))
   :effect (and (not (on ?b ?a)) (delivered ?b))))
""",
    """
(define (problem P01_NET1_B2) (:domain pipesworld_strips_deadlines)
 (:objects B0 B1 - batch-atom A1 A2 - area S12 - pipe)
 (:init (normal S12) (may-interface lco gasoleo) (may-interface gasoleo lco) (connect A1 A2 S12) (is-product B0 lco)
   (is-product B1 gasoleo) (on B0 A1) (first B1 S12) (= (speed S12) 3) (at 0.5 (deliverable B1 gasoleo A2))
   (at 8 (not (deliverable B1 gasoleo A2))))
 (:goal (and (delivered B1) (first B0 S12)))
 (:metric minimize (total-time)))
""",
    """; Time 0.00
; 0.67 metric
0.001: (push-unitarypipe s12 b0 b1 a1 a2 lco gasoleo) [0.667]
0.669: (deliver b1 gasoleo a2) [0.001]
""",
    2,
)

SATELLITE = Printed(
    """
(define (domain satellite)
  (:requirements :typing :fluents :durative-actions :equality :timed-initial-literals :duration-inequalities)
  (:types satellite direction instrument mode antenna)
  (:predicates (on_board ?i - instrument ?s - satellite) (supports ?i - instrument ?m - mode)
    (pointing ?s - satellite ?d - direction) (power_avail ?s - satellite) (power_on ?i - instrument)
    (calibrated ?i - instrument) (have_image ?d - direction ?m - mode) (available ?a - antenna)
    (visible ?a - antenna ?s - satellite) (calibration_target ?i - instrument ?d - direction)
    (sent_image ?d - direction ?m - mode))
  (:functions (slew_time ?a ?b - direction) (calibration_time ?a - instrument ?d - direction)
    (data_capacity ?s - satellite) (data ?d - direction ?m - mode) (data-stored) (fuel ?s - satellite))
  (:durative-action turn_to :parameters (?s - satellite ?d_new - direction ?d_prev - direction)
    :duration (= ?duration (slew_time ?d_prev ?d_new))
    :condition (and (at start (pointing ?s ?d_prev)) (over all (not (= ?d_new ?d_prev)))
      (at start (>= (fuel ?s) (slew_time ?d_prev ?d_new))))
    :effect (and (at end (pointing ?s ?d_new)) (at start (not (pointing ?s ?d_prev)))
      (at end (decrease (fuel ?s) (slew_time ?d_prev ?d_new)))))
  (:durative-action switch_on :parameters (?i - instrument ?s - satellite) :duration (= ?duration 2)
    :condition (and (over all (on_board ?i ?s)) (at start (power_avail ?s)))
    :effect (and (at end (power_on ?i)) (at start (not (calibrated ?i))) (at start (not (power_avail ?s)))))
  (:durative-action calibrate :parameters (?s - satellite ?i - instrument ?d - direction)
    :duration (= ?duration (calibration_time ?i ?d))
    :condition (and (over all (on_board ?i ?s)) (over all (calibration_target ?i ?d)) (at start (pointing ?s ?d))
      (over all (power_on ?i)) (at end (power_on ?i)))
    :effect (at end (calibrated ?i)))
  (:durative-action take_image :parameters (?s - satellite ?d - direction ?i - instrument ?m - mode)
    :duration (= ?duration 7)
    :condition (and (over all (calibrated ?i)) (over all (on_board ?i ?s)) (over all (supports ?i ?m))
      (over all (power_on ?i)) (over all (pointing ?s ?d)) (at start (>= (data_capacity ?s) (data ?d ?m))))
    :effect (and (at start (decrease (data_capacity ?s) (data ?d ?m))) (at end (have_image ?d ?m))
      (at end (increase (data-stored) (data ?d ?m)))))
  (:durative-action send_image :parameters (?s - satellite ?a - antenna ?d - direction ?m - mode)
    :duration (and (>= ?duration 5) (<= ?duration (data ?d ?m)))
    :condition (and (at start (have_image ?d ?m)) (over all (visible ?a ?s)) (at start (available ?a)))
    :effect (and (at start (not (available ?a))) (at end (available ?a)) (at end (sent_image ?d ?m)))))
""",
    """
(define (problem strips-sat-x-1) (:domain satellite)
  (:objects satellite0 - satellite instrument0 - instrument infrared0 - mode
    Star0 Planet1 - direction antenna0 - antenna)
  (:init (on_board instrument0 satellite0) (supports instrument0 infrared0) (calibration_target instrument0 Star0)
    (pointing satellite0 Planet1) (power_avail satellite0) (= (slew_time Planet1 Star0) 11.57)
    (= (slew_time Star0 Planet1) 11.57) (= (calibration_time instrument0 Star0) 3.4) (= (data_capacity satellite0) 100)
    (= (data Planet1 infrared0) 22.5) (= (data-stored) 0) (= (fuel satellite0) 60) (available antenna0)
    (at 30 (visible antenna0 satellite0)) (at 60 (not (visible antenna0 satellite0))))
  (:goal (and (sent_image Planet1 infrared0) (pointing satellite0 planet1)))
  (:metric minimize (total-time)))
""",
    """0.000: (switch_on instrument0 satellite0) [2.000]
0.000: (turn_to satellite0 star0 planet1) [11.570]
11.571: (calibrate satellite0 instrument0 star0) [3.400]
14.972: (turn_to satellite0 planet1 star0) [11.570]
26.543: (take_image satellite0 planet1 instrument0 infrared0) [7.000]
33.544: (send_image satellite0 antenna0 planet1 infrared0) [5.000]
""",
    6,
)

ZENO = Printed(
    """
(define (domain zeno-travel)
(:requirements :durative-actions :typing :fluents)
(:types aircraft person - locatable locatable city - object)
(:predicates (at ?x - (either person aircraft) ?c - city) (in ?p - person ?a - aircraft))
(:functions (fuel ?a - aircraft) (distance ?c1 - city ?c2 - city) (slow-speed ?a - aircraft) (slow-burn ?a - aircraft)
  (capacity ?a - aircraft) (refuel-rate ?a - aircraft) (total-fuel-used) (boarding-time) (debarking-time))
(:durative-action board :parameters (?p - person ?a - aircraft ?c - city) :duration (= ?duration (boarding-time))
 :condition (and (at start (at ?p ?c)) (over all (at ?a ?c)))
 :effect (and (at start (not (at ?p ?c))) (at end (in ?p ?a))))
(:durative-action fly :parameters (?a - aircraft ?c1 ?c2 - city)
 :duration (= ?duration (/ (distance ?c1 ?c2) (slow-speed ?a)))
 :condition (and (at start (at ?a ?c1)) (at start (>= (fuel ?a) (* (distance ?c1 ?c2) (slow-burn ?a)))))
 :effect (and (at start (not (at ?a ?c1))) (at end (at ?a ?c2))
   (at end (increase (total-fuel-used) (* (distance ?c1 ?c2) (slow-burn ?a))))
   (at end (decrease (fuel ?a) (* (distance ?c1 ?c2) (slow-burn ?a))))))
(:durative-action refuel :parameters (?a - aircraft ?c - city)
 :duration (= ?duration (/ (- (capacity ?a) (fuel ?a)) (refuel-rate ?a)))
 :condition (and (at start (> (capacity ?a) (fuel ?a))) (over all (at ?a ?c)))
 :effect (at end (assign (fuel ?a) (capacity ?a)))))
""",
    """
(define (problem ZTRAVEL-1-2) (:domain zeno-travel)
(:objects plane1 - aircraft person1 - person city0 city1 - city)
(:init (at plane1 city0) (= (slow-speed plane1) 198) (= (capacity plane1) 10232) (= (fuel plane1) 2000)
  (= (slow-burn plane1) 4) (= (refuel-rate plane1) 733) (at person1 city0) (= (distance city0 city1) 678)
  (= (distance city1 city0) 678) (= (distance city0 city0) 0) (= (distance city1 city1) 0) (= (total-fuel-used) 0)
  (= (boarding-time) 0.3) (= (debarking-time) 0.6))
(:goal (and (in person1 plane1) (at plane1 city1)))
(:metric minimize (+ (* 4 (total-time)) (* 0.005 (total-fuel-used)))))
""",
    """; Plan found with metric 57.3
0.000: (refuel plane1 city0)  [11.231]
0.000: (board person1 plane1 city0)  [0.300]
11.232: (fly plane1 city0 city1)  [3.424]
""",
    3,
)

DEPOTS = Printed(
    """
(define (domain Depot)
(:requirements :typing :durative-actions :fluents)
(:types place locatable - object depot distributor - place truck hoist surface - locatable pallet crate - surface)
(:predicates (at ?x - locatable ?y - place) (on ?x - crate ?y - surface) (in ?x - crate ?y - truck)
  (lifting ?x - hoist ?y - crate) (available ?x - hoist) (clear ?x - surface))
(:functions (distance ?x - place ?y - place) (speed ?t - truck) (weight ?c - crate) (power ?h - hoist))
(:durative-action Drive :parameters (?x - truck ?y - place ?z - place)
 :duration (= ?duration (/ (distance ?y ?z) (speed ?x)))
 :condition (and (at start (at ?x ?y))) :effect (and (at start (not (at ?x ?y))) (at end (at ?x ?z))))
(:durative-action Lift :parameters (?x - hoist ?y - crate ?z - surface ?p - place) :duration (= ?duration 1)
 :condition (and (over all (at ?x ?p)) (at start (available ?x)) (at start (at ?y ?p)) (at start (on ?y ?z))
   (at start (clear ?y)))
 :effect (and (at start (not (at ?y ?p))) (at start (lifting ?x ?y)) (at start (not (clear ?y)))
   (at start (not (available ?x))) (at start (clear ?z)) (at start (not (on ?y ?z)))))
(:durative-action Load :parameters (?x - hoist ?y - crate ?z - truck ?p - place)
 :duration (= ?duration (/ (weight ?y) (power ?x)))
 :condition (and (over all (at ?x ?p)) (over all (at ?z ?p)) (over all (lifting ?x ?y)))
 :effect (and (at end (not (lifting ?x ?y))) (at end (in ?y ?z)) (at end (available ?x)))))
""",
    """
(define (problem depotprob1818) (:domain Depot)
(:objects depot0 - depot distributor0 - distributor truck0 - truck pallet0 - pallet crate0 - crate hoist0 - hoist)
(:init (at pallet0 depot0) (clear crate0) (at truck0 distributor0) (= (speed truck0) 6) (at hoist0 depot0)
 (available hoist0) (= (power hoist0) 7) (at crate0 depot0) (on crate0 pallet0) (= (weight crate0) 99)
 (= (distance distributor0 depot0) 10) (= (distance depot0 distributor0) 10))
(:goal (and (in crate0 truck0) (at truck0 distributor0)))
(:metric minimize (total-time)))
""",
    """  0.000: Lift(hoist0, crate0, pallet0, depot0) [1.000]
  0.000: Drive(truck0, distributor0, depot0) [1.667]
  1.668: Load(hoist0, crate0, truck0, depot0) [14.143]
 15.812: Drive(truck0, depot0, distributor0) [1.667]
""",
    4,
)

UMTS = Printed(
    """
(define (domain umts)
 (:requirements :durative-actions :typing :fluents)
 (:types application mobile message actions - object)
 (:predicates (initiated ?a - application ?m - mobile) (logical-channel-setup ?a - application)
   (message-part ?a - actions ?m - message) (trm-possible) (ag1a-ok ?a - application) (setup ?a - application))
 (:functions (num-mobiles) (num-calls) (max-num-mobile) (max-num-calls) (num-network) (max-num-network)
   (time-trm ?a - application) (time-trm-ue ?a - application) (d-trm ?a - actions))
 (:durative-action TRM :parameters (?a1 - application ?b - mobile ?c - actions)
   :duration (= ?duration (time-trm ?a1))
   :condition (and (at start (< (num-mobiles) (max-num-mobile))) (at start (initiated ?a1 ?b))
     (at start (<= (+ (num-calls) (d-trm ?c)) (max-num-calls))) (over all (trm-possible)))
   :effect (and (at start (increase (num-mobiles) 1)) (at start (increase (num-calls) (d-trm ?c)))
     (at end (decrease (num-mobiles) 1)) (at end (decrease (num-calls) (d-trm ?c)))
     (at end (logical-channel-setup ?a1))))
 (:durative-action AG1-A :parameters (?a1 - application) :duration (= ?duration (* 2 (time-trm-ue ?a1)))
   :condition (and (at start (logical-channel-setup ?a1)) (at start (<= (num-network) (- (max-num-network) 1))))
   :effect (and (at start (scale-up (num-network) 2)) (at end (scale-down (num-network) 2)) (at end (setup ?a1)))))
""",
    """
(define (problem umts-1) (:domain UMTS)
 (:objects app1 app2 - application mob1 - mobile act1 - actions)
 (:init (initiated app1 mob1) (initiated app2 mob1) (trm-possible) (= (num-mobiles) 0) (= (max-num-mobile) 4)
  (= (num-calls) 0) (= (max-num-calls) 6) (= (num-network) 1) (= (max-num-network) 3) (= (time-trm app1) 76)
  (= (time-trm app2) 31) (= (d-trm act1) 2) (= (time-trm-ue app1) 6.25) (= (time-trm-ue app2) 4.125))
 (:goal (and (setup app1) (setup app2)))
 (:metric minimize (total-time)))
""",
    """
Solution number: 1
Total time:      0.01
0.0003:   (TRM APP1 MOB1 ACT1) [76.0000]
0.0013:   (TRM APP2 MOB1 ACT1) [31.0000]
31.0025:  (AG1-A APP2) [8.2500]
76.0015:  (AG1-A APP1) [12.5000]
""",
    4,
)

AIRPORT = Printed(
    """
(define (domain airport_fixed_structure)
 (:requirements :adl :durative-actions :fluents :constraints)
 (:types airplane segment direction airplanetype)
 (:constants north south - direction light medium heavy - airplanetype seg_pp_0_60 seg_rw_0_400 - segment
   airplane_CFBEG - airplane)
 (:predicates (has-type ?a - airplane ?t - airplanetype) (at-segment ?a - airplane ?s - segment)
   (facing ?a - airplane ?d - direction) (occupied ?s - segment) (blocked ?s - segment ?a - airplane)
   (is-start-runway ?s - segment ?d - direction) (airborne ?a - airplane ?s - segment) (is-moving ?a - airplane)
   (is-pushing ?a - airplane) (can-move ?s1 ?s2 - segment ?d - direction))
 (:functions (length ?s - segment) (engines ?a - airplane))
 (:durative-action move :parameters (?a - airplane ?t - airplanetype ?d1 - direction ?s1 ?s2 - segment ?d2 - direction)
   :duration (= ?duration (/ (length ?s1) 30))
   :condition (and (over all (has-type ?a ?t)) (over all (is-moving ?a)) (at start (facing ?a ?d1))
     (over all (can-move ?s1 ?s2 ?d1)) (at start (at-segment ?a ?s1)) (at start (not (occupied ?s2)))
     (at start (forall (?b - airplane) (imply (blocked ?s2 ?b) (= ?b ?a)))))
   :effect (and (at start (occupied ?s2)) (at start (blocked ?s2 ?a)) (at end (not (occupied ?s1)))
     (at start (not (at-segment ?a ?s1))) (at end (at-segment ?a ?s2))
     (when (at end (not (is-start-runway ?s1 ?d1))) (at end (not (blocked ?s1 ?a))))))
 (:durative-action startup :parameters (?a - airplane) :duration (= ?duration (* 60 (engines ?a)))
   :condition (at start (is-pushing ?a))
   :effect (and (at end (not (is-pushing ?a))) (at end (is-moving ?a))))
 (:durative-action takeoff_CFBEG :parameters (?s - segment ?d - direction) :duration (= ?duration 30)
   :condition (and (at start (at-segment airplane_CFBEG ?s)) (at start (facing airplane_CFBEG ?d))
      (over all (is-start-runway ?s ?d)) (over all (or (facing airplane_CFBEG north) (facing airplane_CFBEG south))))
   :effect (and (at end (not (occupied ?s))) (at end (airborne airplane_CFBEG ?s))
      (at start (not (is-moving airplane_CFBEG)))
      (at start (not (at-segment airplane_CFBEG ?s)))
      (forall (?x - segment) (when (at end (blocked ?x airplane_CFBEG)) (at end (not (blocked ?x airplane_CFBEG))))))))
""",
    """
(define (problem p1) (:domain AIRPORT_fixed_structure)
 (:init (has-type airplane_CFBEG medium) (at-segment airplane_CFBEG seg_pp_0_60) (facing airplane_CFBEG south)
  (occupied seg_pp_0_60) (blocked seg_pp_0_60 airplane_CFBEG) (is-start-runway seg_rw_0_400 south)
  (can-move seg_pp_0_60 seg_rw_0_400 south) (is-pushing airplane_CFBEG) (= (engines airplane_CFBEG) 2)
  (= (length seg_pp_0_60) 60.5) (= (length seg_rw_0_400) 400))
 (:goal (and (airborne airplane_CFBEG seg_rw_0_400) (not (occupied seg_rw_0_400)))))
""",
    """0.001: (startup airplane_cfbeg) [120.000]
120.002: (move airplane_cfbeg medium south seg_pp_0_60 seg_rw_0_400 south) [2.017]
122.020: (takeoff_cfbeg seg_rw_0_400 south) [30.000]
""",
    3,
)

RICH = Printed(
    """
(define (domain lab)
  (:requirements :adl :durative-actions :numeric-fluents :duration-inequalities :continuous-effects
    :timed-initial-literals)
  (:types door tank lamp)
  (:constants main - tank)
  (:predicates (open ?d - door) (lit ?l - lamp) (alarm) (checked) (power) (spare))
  (:functions (level ?t - tank) (rate ?t - tank) (limit ?t - tank))
  (:durative-action fill :parameters (?t - tank)
    :duration (and (at start (>= ?duration 2)) (at end (<= ?duration (/ (limit ?t) (rate ?t)))))
    :condition (and (over all (<= (level ?t) (limit ?t))) (over all (or (power) (spare)))
      (over all (not (alarm))) (at start (forall (?d - door) (open ?d))) (at end (exists (?l - lamp) (lit ?l))))
    :effect (and (increase (level ?t) (* #t (rate ?t)))))
  (:durative-action inspect :parameters () :duration (>= ?duration 1)
    :condition (and (over all (forall (?d - door) (open ?d))))
    :effect (and (when (at end (power)) (at end (checked))) (forall (?l - lamp) (at start (lit ?l)))))
  (:action unlock :parameters (?d - door) :precondition (not (open ?d)) :effect (open ?d)))
""",
    """
(define (problem evening) (:domain Lab)
  (:objects d1 d2 - door l1 l2 - lamp)
  (:init (open d1) (power) (= (level main) 1.5) (= (rate main) 2) (= (limit main) 9) (at 1 (spare))
    (at 9 (not (power))))
  (:goal (and (checked) (>= (level main) 7) (imply (alarm) (open d1)))))
""",
    """Solution Found!
Plan cost: 4.0
0.500: (unlock d2)
0.501: (fill main) [3.000]
1.100: (inspect) [1.500]
""",
    3,
)

NO_DECLARATIONS = Printed(
    """
(define (domain tiny)
  (:predicates (on) (warm))
  (:functions (heat) (total-cost))
  (:durative-action idle :parameters () :duration (= ?duration 1) :condition () :effect ())
  (:action press :parameters () :precondition () :effect ())
  (:action switch :precondition (and) :effect (and (on) (increase (total-cost) 1)))
  (:durative-action boil :parameters () :duration (= ?duration (/ (heat) 3))
    :condition (over all (on)) :effect (and (at end (warm)) (at end (increase (total-cost) ?duration)))))
""",
    """
(define (problem tea) (:domain TINY) (:init (= (heat) 10) (= (total-cost) 0)) (:goal (warm)))
""",
    """0.000: (switch)
0.001: (boil) [3.333]
1.000: (idle) [1.000]
1.000: (press)
""",
    4,
    val=False,
)

TRUCKS = Printed(
    """
(define (domain Trucks-Time)
(:requirements :typing :durative-actions :fluents :timed-initial-literals)
(:types truckarea location locatable - object truck package - locatable)
(:predicates (at ?x - locatable ?l - location) (in ?p - package ?t - truck ?a - truckarea) (connected ?x ?y - location)
  (free ?a - truckarea ?t - truck) (delivered ?p - package ?l - location) (closer ?a1 - truckarea ?a2 - truckarea)
  (deliverable ?p - package ?l - location))
(:functions (drive-time ?from ?to - location))
(:durative-action load :parameters (?p - package ?t - truck ?a1 - truckarea ?l - location) :duration (= ?duration 1)
  :condition (and (at start (at ?p ?l)) (at start (free ?a1 ?t))
    (at start (forall (?a2 - truckarea) (imply (closer ?a2 ?a1) (free ?a2 ?t))))
    (over all (at ?t ?l)) (over all (forall (?a2 - truckarea) (imply (closer ?a2 ?a1) (free ?a2 ?t)))))
  :effect (and (at start (not (at ?p ?l))) (at start (not (free ?a1 ?t))) (at end (in ?p ?t ?a1))))
(:durative-action drive :parameters (?t - truck ?from ?to - location) :duration (= ?duration (drive-time ?from ?to))
  :condition (and (at start (at ?t ?from)) (over all (connected ?from ?to)))
  :effect (and (at start (not (at ?t ?from))) (at end (at ?t ?to))))
(:durative-action unload :parameters (?p - package ?t - truck ?a1 - truckarea ?l - location) :duration (= ?duration 1)
  :condition (and (at start (in ?p ?t ?a1)) (over all (at ?t ?l)))
  :effect (and (at start (not (in ?p ?t ?a1))) (at end (free ?a1 ?t)) (at end (at ?p ?l))))
(:durative-action deliver :parameters (?p - package ?l - location) :duration (= ?duration 1)
  :condition (and (over all (at ?p ?l)) (over all (deliverable ?p ?l)))
  :effect (and (at end (not (at ?p ?l))) (at end (delivered ?p ?l)))))
""",
    """
(define (problem truck-1) (:domain Trucks-Time)
(:objects truck1 - truck package1 - package l1 l2 - location a1 a2 - truckarea)
(:init (at truck1 l1) (free a1 truck1) (free a2 truck1) (closer a1 a2) (at package1 l1) (connected l1 l2)
  (= (drive-time l1 l2) 543.2) (deliverable package1 l2) (at 547.001 (not (deliverable package1 l2))))
(:goal (and (delivered package1 l2)))
(:metric minimize (total-time)))
""",
    """Found solution in 0.1 s:
  0.00: (load package1 truck1 a2 l1) [1.00]
  1.00: (drive truck1 l1 l2) [543.20]
  544.20: (unload package1 truck1 a2 l2) [1.00]
  545.20: (deliver package1 l2) [1.00]
""",
    4,
)

PLANS = {**PROPOSITIONAL, **named(globals())}
"""All of them, by the domain that they are like."""
