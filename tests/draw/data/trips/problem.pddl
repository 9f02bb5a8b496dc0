(define (problem there_and_back) (:domain trips) (:objects a b - place)
  (:init (at a) (= (fuel) 9))
  (:goal (and (at a) (> (fuel) 0))))
