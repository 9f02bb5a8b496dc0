; Robot delivery with batteries: every action checks at its start that enough battery is left, and takes some. How much is
; uncertain: a move has a parameter of its own for each instance, all handling shares one for the domain.

(define (domain robot_delivery_battery)
  (:requirements :typing :fluents :durative-actions :duration-inequalities :timed-initial-literals :universal-preconditions)

  (:types robot place order step ring)

  (:synth-parameters ?handling)            ; battery that picking, placing, collecting, mounting or delivering takes

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
    (step-time ?s - step)                  ; seconds
    (battery ?r - robot))                  ; percent

  (:durative-action move                   ; at 1 metre per second at most
    :parameters (?r - robot ?a ?b - place)
    :synth-parameters (?use)               ; battery that this move takes
    :duration (>= ?duration (distance ?a ?b))
    :condition (and
      (at start (at ?r ?a))
      (at start (>= (battery ?r) ?use)))
    :effect (and
      (at start (not (at ?r ?a)))
      (at end (at ?r ?b))
      (at end (decrease (battery ?r) ?use))))

  (:durative-action pick-spindle
    :parameters (?r - robot ?o - order ?p - place)
    :duration (= ?duration 10)
    :condition (and
      (at start (>= (battery ?r) ?handling))
      (at start (is-shelf ?p))
      (at start (hands-free ?r))
      (over all (at ?r ?p)))
    :effect (and
      (at end (decrease (battery ?r) ?handling))
      (at start (not (hands-free ?r)))
      (at end (holds-spindle ?r ?o))))

  (:durative-action place-spindle
    :parameters (?r - robot ?o - order ?p - place)
    :duration (= ?duration 5)
    :condition (and
      (at start (>= (battery ?r) ?handling))
      (at start (is-base-station ?p))
      (at start (holds-spindle ?r ?o))
      (over all (at ?r ?p)))
    :effect (and
      (at end (decrease (battery ?r) ?handling))
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
      (at start (>= (battery ?r) ?handling))
      (at start (is-base-station ?p))
      (at start (joined ?o))
      (at start (hands-free ?r))
      (over all (at ?r ?p))
      (over all (at ?helper ?p))
      (over all (hands-free ?helper)))
    :effect (and
      (at end (decrease (battery ?r) ?handling))
      (at start (not (hands-free ?r)))
      (at start (not (joined ?o)))
      (at end (holds-base ?r ?o))))

  (:durative-action mount
    :parameters (?r - robot ?o - order ?below ?g - ring ?p - place)
    :duration (= ?duration 30)
    :condition (and
      (at start (>= (battery ?r) ?handling))
      (at start (is-ring-station ?p))
      (at start (on-top ?o ?below ?g))
      (at start (or (mounted ?o ?below) (on-top ?o ?g ?g)))
      (over all (holds-base ?r ?o))
      (over all (at ?r ?p)))
    :effect (and
      (at end (mounted ?o ?g))
      (at end (decrease (battery ?r) ?handling))))

  (:durative-action deliver
    :parameters (?r - robot ?o - order ?p - place)
    :duration (= ?duration 10)
    :condition (and
      (at start (>= (battery ?r) ?handling))
      (at start (is-gate ?p))
      (at start (holds-base ?r ?o))
      (at start (forall (?g - ring) (imply (ring-of ?o ?g) (mounted ?o ?g))))
      (over all (at ?r ?p))
      (over all (order-open ?o)))
    :effect (and
      (at end (decrease (battery ?r) ?handling))
      (at start (not (holds-base ?r ?o)))
      (at end (hands-free ?r))
      (at end (delivered ?o)))))
