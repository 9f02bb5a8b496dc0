(define (problem beside)
(:domain beside)
(:init )
(:goal (and)))
