(define (problem not-needed)
(:domain not-needed)
(:init )
(:goal (and)))
