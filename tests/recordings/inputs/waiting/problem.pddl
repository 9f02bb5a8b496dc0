(define (problem p) (:domain d) (:init) (:goal (done)))
