(define (problem trip) (:domain delivery) (:objects a b c - place v - van)
  (:init (at v a)) (:goal (and (at v c) (rung))))
