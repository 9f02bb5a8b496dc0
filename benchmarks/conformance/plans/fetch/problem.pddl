(define (problem fetch)
(:domain fetch)
(:init )
(:goal (and)))
