; Jobs that drain a battery by as much as they take time.

(define (domain battery)
  (:requirements :typing :durative-actions :numeric-fluents :duration-inequalities)

  (:types job)

  (:predicates (done ?j - job) (watched))

  (:functions (energy))

  (:durative-action watch
    :parameters ()
    :duration (>= ?duration 0)
    :condition (over all (>= (energy) 0))
    :effect (at end (watched)))

  (:durative-action work
    :parameters (?j - job)
    :duration (>= ?duration 0)
    :condition (and)
    :effect (and (at end (decrease (energy) ?duration)) (at end (done ?j)))))
