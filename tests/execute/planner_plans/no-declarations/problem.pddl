(define (problem tea) (:domain TINY) (:init (= (heat) 10) (= (total-cost) 0)) (:goal (warm)))
