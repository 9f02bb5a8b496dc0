(define (problem p) (:domain d) (:init (= (pace) 5) (= (left) 100)) (:goal (done)))
