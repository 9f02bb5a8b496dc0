(define (domain sat)
  (:requirements :typing :negative-preconditions :durative-actions :duration-inequalities)
  (:predicates
    (clause-holds-1)
    (clause-holds-2)
  )
  (:durative-action assign-1
    :parameters ()
    :duration (>= ?duration 0)
    :condition (and )
    :effect (and (at end (clause-holds-1))))
  (:durative-action assign-not-1
    :parameters ()
    :duration (>= ?duration 0)
    :condition (and )
    :effect (and (at end (clause-holds-2))))
  (:durative-action assign-2
    :parameters ()
    :duration (>= ?duration 0)
    :condition (and )
    :effect (and (at end (clause-holds-1)) (at end (clause-holds-2))))
  (:durative-action assign-not-2
    :parameters ()
    :duration (>= ?duration 0)
    :condition (and )
    :effect (and ))
  (:durative-action clause-1
    :parameters ()
    :duration (>= ?duration 0)
    :condition (and (at start (clause-holds-1)))
    :effect (and ))
  (:durative-action clause-2
    :parameters ()
    :duration (>= ?duration 0)
    :condition (and (at start (clause-holds-2)))
    :effect (and ))
)
