(define (problem impossible)
(:domain impossible)
(:init )
(:goal (and)))
