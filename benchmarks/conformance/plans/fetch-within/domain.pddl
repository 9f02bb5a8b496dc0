(define (domain fetch-within)
(:requirements :typing :negative-preconditions :durative-actions :duration-inequalities)
(:predicates (have))
(:durative-action fetch
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (have))))
(:durative-action use
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and (at start (have)))
 :effect (and)))
