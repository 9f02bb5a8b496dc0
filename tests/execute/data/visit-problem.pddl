(define (problem one_guest) (:domain visit) (:init (idle)) (:goal (and (guest) (tea))))
