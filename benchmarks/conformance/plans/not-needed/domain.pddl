(define (domain not-needed)
(:requirements :typing :negative-preconditions :durative-actions :duration-inequalities)
(:predicates (have) (used))
(:durative-action fetch
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (have))))
(:durative-action use
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (used)))))
