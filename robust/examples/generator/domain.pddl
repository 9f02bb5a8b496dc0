; A generating set burns fuel all through its shift, while canisters are poured into its tank. Pouring is continuous too:
; the tank has to stay below its size during every pouring, and must not run dry before the shift is over.

(define (domain generating_set)
  (:requirements :typing :fluents :durative-actions)

  (:types genset canister)

  (:predicates
    (sealed ?c - canister)
    (emptied ?c - canister)
    (shift-done ?g - genset))

  (:functions
    (fuel ?g - genset)
    (tank-size ?g - genset)
    (burn-rate ?g - genset)        ; litres per minute
    (shift-length ?g - genset)     ; minutes
    (pour-rate ?c - canister)      ; litres per minute
    (pour-time ?c - canister))     ; minutes until the canister is empty

  (:durative-action run-shift
    :parameters (?g - genset)
    :duration (= ?duration (shift-length ?g))
    :condition (over all (>= (fuel ?g) 0))
    :effect (and
      (decrease (fuel ?g) (* #t (burn-rate ?g)))
      (at end (shift-done ?g))))

  (:durative-action pour
    :parameters (?g - genset ?c - canister)
    :duration (= ?duration (pour-time ?c))
    :condition (and
      (at start (sealed ?c))
      (over all (< (fuel ?g) (tank-size ?g))))
    :effect (and
      (at start (not (sealed ?c)))
      (increase (fuel ?g) (* #t (pour-rate ?c)))
      (at end (emptied ?c)))))
