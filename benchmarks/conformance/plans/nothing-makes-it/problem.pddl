(define (problem nothing-makes-it)
(:domain nothing-makes-it)
(:init )
(:goal (and)))
