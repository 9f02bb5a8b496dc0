(define (problem two) (:domain tasks) (:objects a b - task)
  (:init (ready a) (open) (at 60 (not (open))) (= (need a) 3) (= (need b) 4) (= (stock) 10))
  (:goal (and (done a) (done b))))
