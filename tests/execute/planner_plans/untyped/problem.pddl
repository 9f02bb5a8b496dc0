(define (problem strips-gripper-x-1) (:domain gripper-temporal)
  (:objects rooma roomb ball1 left)
  (:init (room rooma) (room roomb) (ball ball1) (at-robby rooma) (free left) (at ball1 roomb) (gripper left))
  (:goal (carry ball1 left)))
