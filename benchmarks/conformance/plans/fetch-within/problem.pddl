(define (problem fetch-within)
(:domain fetch-within)
(:init )
(:goal (and)))
