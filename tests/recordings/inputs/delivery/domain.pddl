(define (domain robot-delivery)
(:requirements :typing :fluents :durative-actions :timed-initial-literals)
(:types robot location spindle order level task - object
        step - task)
(:constants step1 step2 step3 step4 step5 step6 - step)
(:predicates
  (robot_at ?r - robot ?l - location)
  (hand_empty ?r - robot)
  (holding ?r - robot ?p - spindle)
  (shelf_at ?l - location)
  (base_station_at ?l - location)
  (ring_station_at ?l - location)
  (gate_at ?o - order ?l - location)
  (on_shelf ?p - spindle)              ; not collected yet
  (spindle_of ?p - spindle ?o - order) ; what is made of it fits this order
  (prepared ?p - spindle ?s - step)    ; the step has been done for its base
  (rings ?p - spindle ?n - level)      ; it has a base with so many rings
  (first_level ?n - level)
  (next_level ?m ?n - level)
  (wants ?o - order ?n - level)
  (station_free ?l - location)
  (window_open ?o - order)
  (fulfilled ?o - order)
  (some_fulfilled))
(:functions
  (distance ?a ?b - location)
  (preparation_time ?s - step))

(:durative-action move
  :parameters (?r - robot ?from ?to - location)
  :duration (= ?duration (distance ?from ?to))
  :condition (and
    (at start (robot_at ?r ?from)))
  :effect (and
    (at start (not (robot_at ?r ?from)))
    (at end (robot_at ?r ?to))))
(:durative-action collect
  :parameters (?r - robot ?p - spindle ?l - location)
  :duration (= ?duration 15)
  :condition (and
    (at start (shelf_at ?l))
    (at start (on_shelf ?p))
    (at start (hand_empty ?r))
    (over all (robot_at ?r ?l)))
  :effect (and
    (at start (not (on_shelf ?p)))
    (at start (not (hand_empty ?r)))
    (at end (holding ?r ?p))))
(:durative-action prepare_step1
  :parameters (?r - robot ?p - spindle ?l - location)
  :duration (= ?duration (preparation_time step1))
  :condition (and
    (at start (base_station_at ?l))
    (over all (robot_at ?r ?l))
    (over all (holding ?r ?p)))
  :effect (and
    (at end (prepared ?p step1))))
(:durative-action prepare_step2
  :parameters (?r - robot ?p - spindle ?l - location)
  :duration (= ?duration (preparation_time step2))
  :condition (and
    (at start (base_station_at ?l))
    (over all (robot_at ?r ?l))
    (over all (holding ?r ?p)))
  :effect (and
    (at end (prepared ?p step2))))
(:durative-action prepare_step3
  :parameters (?r - robot ?p - spindle ?l - location)
  :duration (= ?duration (preparation_time step3))
  :condition (and
    (at start (base_station_at ?l))
    (over all (robot_at ?r ?l))
    (over all (holding ?r ?p)))
  :effect (and
    (at end (prepared ?p step3))))
(:durative-action prepare_step4
  :parameters (?r - robot ?p - spindle ?l - location)
  :duration (= ?duration (preparation_time step4))
  :condition (and
    (at start (base_station_at ?l))
    (over all (robot_at ?r ?l))
    (over all (holding ?r ?p)))
  :effect (and
    (at end (prepared ?p step4))))
(:durative-action prepare_step5
  :parameters (?r - robot ?p - spindle ?l - location)
  :duration (= ?duration (preparation_time step5))
  :condition (and
    (at start (base_station_at ?l))
    (over all (robot_at ?r ?l))
    (over all (holding ?r ?p)))
  :effect (and
    (at end (prepared ?p step5))))
(:durative-action prepare_step6
  :parameters (?r - robot ?p - spindle ?l - location)
  :duration (= ?duration (preparation_time step6))
  :condition (and
    (at start (base_station_at ?l))
    (over all (robot_at ?r ?l))
    (over all (holding ?r ?p)))
  :effect (and
    (at end (prepared ?p step6))))
(:durative-action assemble
  :parameters (?r - robot ?p - spindle ?l - location ?n - level)
  :duration (= ?duration 40)
  :condition (and
    (at start (base_station_at ?l))
    (at start (first_level ?n))
    (at start (prepared ?p step1))
    (at start (prepared ?p step2))
    (at start (prepared ?p step3))
    (at start (prepared ?p step4))
    (at start (prepared ?p step5))
    (at start (prepared ?p step6))
    (over all (robot_at ?r ?l))
    (over all (holding ?r ?p)))
  :effect (and
    (at end (rings ?p ?n))))
(:durative-action mount
  :parameters (?r - robot ?p - spindle ?l - location ?m ?n - level)
  :duration (= ?duration 35)
  :condition (and
    (at start (ring_station_at ?l))
    (at start (next_level ?m ?n))
    (at start (rings ?p ?m))
    (at start (station_free ?l))
    (over all (robot_at ?r ?l))
    (over all (holding ?r ?p)))
  :effect (and
    (at start (not (rings ?p ?m)))
    (at start (not (station_free ?l)))
    (at end (rings ?p ?n))
    (at end (station_free ?l))))
(:durative-action deliver
  :parameters (?r - robot ?p - spindle ?o - order ?l - location ?n - level)
  :duration (= ?duration 24)
  :condition (and
    (at start (gate_at ?o ?l))
    (at start (spindle_of ?p ?o))
    (at start (wants ?o ?n))
    (at start (rings ?p ?n))
    (at start (holding ?r ?p))
    (over all (robot_at ?r ?l))
    (over all (window_open ?o)))
  :effect (and
    (at start (not (holding ?r ?p)))
    (at end (hand_empty ?r))
    (at end (fulfilled ?o))
    (at end (some_fulfilled))))
(:durative-action dispose
  :parameters (?r - robot ?p - spindle ?l - location)
  :duration (= ?duration 10)
  :condition (and
    (at start (holding ?r ?p))
    (over all (robot_at ?r ?l)))
  :effect (and
    (at start (not (holding ?r ?p)))
    (at end (hand_empty ?r))))
)
