(define (problem order)
(:domain order)
(:init )
(:goal (and)))
