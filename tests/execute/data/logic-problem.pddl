(define (problem x) (:domain logic) (:objects a b c - place t - truck)
(:init (at t a) (blocked a) (blocked b) (at 5 (not (blocked b)))) (:goal (and (at t b) (or (checked) (lit a)))))
