; Two-sample navigation: a rover drives between sites by daylight, on one battery, and takes samples that need light.
; Driving drains the battery as long as it lasts, and the charge may never fall below a reserve.

(define (domain two_sample_navigation)
  (:requirements :typing :fluents :durative-actions :duration-inequalities :timed-initial-literals)

  (:types rover site)

  (:predicates
    (at ?r - rover ?s - site)
    (lit ?s - site)           ; the sun reaches the site
    (daylight)                ; the rover can see where it drives
    (sampled ?s - site))

  (:functions
    (charge ?r - rover)
    (reserve ?r - rover)
    (drain ?from ?to - site)) ; charge used by a minute on this track: tracks differ in steepness

  (:durative-action drive
    :parameters (?r - rover ?from ?to - site)
    :duration (>= ?duration 1)
    :condition (and
      (at start (at ?r ?from))
      (over all (daylight))
      (over all (>= (charge ?r) (reserve ?r))))
    :effect (and
      (at start (not (at ?r ?from)))
      (decrease (charge ?r) (* #t (drain ?from ?to)))
      (at end (at ?r ?to))))

  (:durative-action take-sample
    :parameters (?r - rover ?s - site)
    :duration (= ?duration 10)
    :condition (and
      (over all (at ?r ?s))
      (over all (lit ?s)))
    :effect (and
      (at start (decrease (charge ?r) 6))
      (at end (sampled ?s)))))
