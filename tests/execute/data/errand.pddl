(define (problem one) (:domain errands) (:objects home market - place)
(:init (at home) (open) (at 20 (not (open))) (= (distance home market) 7.5) (= (distance market home) 7.5))
(:goal (done market)))
