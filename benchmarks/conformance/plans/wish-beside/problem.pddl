(define (problem wish-beside)
(:domain wish-beside)
(:init )
(:goal (and)))
