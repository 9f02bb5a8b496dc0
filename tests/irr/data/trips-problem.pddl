(define (problem trip) (:domain trips) (:objects a b - place)
 (:init (= (way) 3) (= (rest) 2) (at home) (at 20 (not (at home)))) (:goal (at a)))
