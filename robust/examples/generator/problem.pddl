; A shift of a generating set that needs 3 canisters besides the fuel in its tank.

(define (problem shift_with_3_canisters)
  (:domain generating_set)

  (:objects
    gen - genset
    can1 can2 can3 - canister)

  (:init
    (= (fuel gen) 50)
    (= (tank-size gen) 70)
    (= (burn-rate gen) 1)
    (= (shift-length gen) 148)
    (sealed can1) (= (pour-rate can1) 3) (= (pour-time can1) 12)
    (sealed can2) (= (pour-rate can2) 3) (= (pour-time can2) 12)
    (sealed can3) (= (pour-rate can3) 3) (= (pour-time can3) 12)
  )

  (:goal (shift-done gen)))
