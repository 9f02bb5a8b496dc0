(define (domain d) (:requirements :durative-actions :duration-inequalities) (:predicates (done))
(:durative-action wait :parameters () :duration (>= ?duration 0) :condition () :effect (at end (done)))
(:durative-action go :parameters () :duration (= ?duration 2) :condition () :effect ())
(:action look :parameters () :precondition () :effect (done)))
