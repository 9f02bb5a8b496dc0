; Underwater vehicles survey sites within windows of time. A transit or a survey takes as much charge as it takes minutes,
; booked at its end, and may begin only if a reserve would remain. A dock charges one vehicle at a time, to its full level.

(define (domain auv_survey)
  (:requirements :typing :fluents :durative-actions :duration-inequalities :timed-initial-literals)

  (:types vehicle place - object
          dock site - place)

  (:predicates
    (at ?v - vehicle ?p - place)
    (berth-free ?d - dock)
    (accessible ?s - site)    ; currents and traffic permit a survey
    (ship-waiting)            ; the ship that takes the vehicles on board is there
    (surveyed ?s - site)
    (recovered ?v - vehicle))

  (:functions
    (charge ?v - vehicle)
    (full ?v - vehicle)
    (reserve ?v - vehicle))

  (:durative-action transit
    :parameters (?v - vehicle ?from ?to - place)
    :duration (>= ?duration 1)
    :condition (and
      (at start (at ?v ?from))
      (at start (>= (charge ?v) (+ ?duration (reserve ?v)))))
    :effect (and
      (at start (not (at ?v ?from)))
      (at end (at ?v ?to))
      (at end (decrease (charge ?v) ?duration))))

  (:durative-action survey
    :parameters (?v - vehicle ?s - site)
    :duration (>= ?duration 1)
    :condition (and
      (over all (at ?v ?s))
      (over all (accessible ?s))
      (at start (>= (charge ?v) (+ ?duration (reserve ?v)))))
    :effect (and
      (at end (surveyed ?s))
      (at end (decrease (charge ?v) ?duration))))

  (:durative-action recharge
    :parameters (?v - vehicle ?d - dock)
    :duration (>= ?duration 30)
    :condition (and
      (at start (berth-free ?d))
      (over all (at ?v ?d)))
    :effect (and
      (at start (not (berth-free ?d)))
      (at end (assign (charge ?v) (full ?v)))
      (at end (berth-free ?d))))

  (:durative-action recover
    :parameters (?v - vehicle ?d - dock)
    :duration (= ?duration 15)
    :condition (and
      (at start (at ?v ?d))
      (over all (ship-waiting)))
    :effect (and
      (at start (not (at ?v ?d)))
      (at end (recovered ?v)))))
