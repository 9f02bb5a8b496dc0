(define (domain order)
(:requirements :typing :negative-preconditions :durative-actions :duration-inequalities)
(:predicates (full) (hot))
(:durative-action fill
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (full)) (at end (not (hot)))))
(:durative-action heat
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (hot))))
(:durative-action serve
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and (at start (full)) (at start (hot)))
 :effect (and)))
