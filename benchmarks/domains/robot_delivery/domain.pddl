; Service robots deliver orders. A robot fetches a spindle from the shelf and places it at the base station, where the
; preparation steps run, possibly in parallel; when all are done the station joins the base. Handing the base out takes
; two robots at the station. Then rings are mounted, one after the other, and the order is delivered before it closes.

(define (domain robot_delivery)
  (:requirements :typing :fluents :durative-actions :duration-inequalities :timed-initial-literals :universal-preconditions)

  (:types robot place order step ring)

  (:predicates
    (at ?r - robot ?p - place)
    (is-shelf ?p - place)
    (is-base-station ?p - place)
    (is-ring-station ?p - place)
    (is-gate ?p - place)
    (hands-free ?r - robot)
    (holds-spindle ?r - robot ?o - order)
    (placed ?o - order)
    (prepared ?o - order ?s - step)
    (joined ?o - order)
    (holds-base ?r - robot ?o - order)
    (ring-of ?o - order ?g - ring)
    (on-top ?o - order ?below ?g - ring)   ; the ring goes on top of the ring below, or of itself if it is the first
    (mounted ?o - order ?g - ring)
    (order-open ?o - order)
    (delivered ?o - order))

  (:functions
    (distance ?a ?b - place)               ; metres
    (step-time ?s - step))                 ; seconds

  (:durative-action move                   ; at 1 metre per second at most
    :parameters (?r - robot ?a ?b - place)
    :duration (>= ?duration (distance ?a ?b))
    :condition (at start (at ?r ?a))
    :effect (and
      (at start (not (at ?r ?a)))
      (at end (at ?r ?b))))

  (:durative-action pick-spindle
    :parameters (?r - robot ?o - order ?p - place)
    :duration (= ?duration 10)
    :condition (and
      (at start (is-shelf ?p))
      (at start (hands-free ?r))
      (over all (at ?r ?p)))
    :effect (and
      (at start (not (hands-free ?r)))
      (at end (holds-spindle ?r ?o))))

  (:durative-action place-spindle
    :parameters (?r - robot ?o - order ?p - place)
    :duration (= ?duration 5)
    :condition (and
      (at start (is-base-station ?p))
      (at start (holds-spindle ?r ?o))
      (over all (at ?r ?p)))
    :effect (and
      (at start (not (holds-spindle ?r ?o)))
      (at end (hands-free ?r))
      (at end (placed ?o))))

  (:durative-action prepare
    :parameters (?o - order ?s - step)
    :duration (>= ?duration (step-time ?s))
    :condition (at start (placed ?o))
    :effect (at end (prepared ?o ?s)))

  (:durative-action join-base
    :parameters (?o - order)
    :duration (= ?duration 20)
    :condition (at start (forall (?s - step) (prepared ?o ?s)))
    :effect (at end (joined ?o)))

  (:durative-action collect
    :parameters (?r ?helper - robot ?o - order ?p - place)
    :duration (= ?duration 15)
    :condition (and
      (at start (is-base-station ?p))
      (at start (joined ?o))
      (at start (hands-free ?r))
      (over all (at ?r ?p))
      (over all (at ?helper ?p))
      (over all (hands-free ?helper)))
    :effect (and
      (at start (not (hands-free ?r)))
      (at start (not (joined ?o)))
      (at end (holds-base ?r ?o))))

  (:durative-action mount
    :parameters (?r - robot ?o - order ?below ?g - ring ?p - place)
    :duration (= ?duration 30)
    :condition (and
      (at start (is-ring-station ?p))
      (at start (on-top ?o ?below ?g))
      (at start (or (mounted ?o ?below) (on-top ?o ?g ?g)))
      (over all (holds-base ?r ?o))
      (over all (at ?r ?p)))
    :effect (at end (mounted ?o ?g)))

  (:durative-action deliver
    :parameters (?r - robot ?o - order ?p - place)
    :duration (= ?duration 10)
    :condition (and
      (at start (is-gate ?p))
      (at start (holds-base ?r ?o))
      (at start (forall (?g - ring) (imply (ring-of ?o ?g) (mounted ?o ?g))))
      (over all (at ?r ?p))
      (over all (order-open ?o)))
    :effect (and
      (at start (not (holds-base ?r ?o)))
      (at end (hands-free ?r))
      (at end (delivered ?o)))))
