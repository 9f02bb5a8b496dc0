(define (domain nothing-makes-it)
(:requirements :typing :negative-preconditions :durative-actions :duration-inequalities)
(:predicates (have) (other))
(:durative-action fetch
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (other))))
(:durative-action use
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and (at start (have)))
 :effect (and)))
