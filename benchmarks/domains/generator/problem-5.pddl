; A shift of a generating set that needs 5 canisters besides the fuel in its tank.

(define (problem shift_with_5_canisters)
  (:domain generating_set)

  (:objects
    gen - genset
    can1 can2 can3 can4 can5 - canister)

  (:init
    (= (fuel gen) 50)
    (= (tank-size gen) 70)
    (= (burn-rate gen) 1)
    (= (shift-length gen) 220)
    (sealed can1) (= (pour-rate can1) 3) (= (pour-time can1) 12)
    (sealed can2) (= (pour-rate can2) 3) (= (pour-time can2) 12)
    (sealed can3) (= (pour-rate can3) 3) (= (pour-time can3) 12)
    (sealed can4) (= (pour-rate can4) 3) (= (pour-time can4) 12)
    (sealed can5) (= (pour-rate can5) 3) (= (pour-time can5) 12)
  )

  (:goal (shift-done gen)))
