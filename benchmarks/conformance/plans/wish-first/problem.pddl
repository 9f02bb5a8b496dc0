(define (problem wish-first)
(:domain wish-first)
(:init )
(:goal (and)))
