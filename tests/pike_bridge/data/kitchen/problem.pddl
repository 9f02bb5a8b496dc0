(define (problem breakfast) (:domain kitchen)
  (:objects human robot - agent mug glass - vessel bagel cereal - food)
  (:init (reachable mug) (reachable glass) (edible bagel) (edible cereal))
  (:goal (and (filled mug) (made bagel))))
