(define (domain wish-beside)
(:requirements :typing :negative-preconditions :durative-actions :duration-inequalities)
(:predicates (tea) (milk) (wants-tea) (wants-milk))
(:durative-action say-tea
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (wants-tea))))
(:durative-action say-milk
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (wants-milk))))
(:durative-action bring-tea
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (tea))))
(:durative-action bring-milk
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and)
 :effect (and (at end (milk))))
(:durative-action pour-tea
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and (at start (tea)) (at start (wants-tea)))
 :effect (and))
(:durative-action pour-milk
 :parameters ()
 :duration (>= ?duration 0)
 :condition (and (at start (milk)) (at start (wants-milk)))
 :effect (and)))
