; A shift of a generating set that needs 8 canisters besides the fuel in its tank.

(define (problem shift_with_8_canisters)
  (:domain generating_set)

  (:objects
    gen - genset
    can1 can2 can3 can4 can5 can6 can7 can8 - canister)

  (:init
    (= (fuel gen) 50)
    (= (tank-size gen) 70)
    (= (burn-rate gen) 1)
    (= (shift-length gen) 328)
    (sealed can1) (= (pour-rate can1) 3) (= (pour-time can1) 12)
    (sealed can2) (= (pour-rate can2) 3) (= (pour-time can2) 12)
    (sealed can3) (= (pour-rate can3) 3) (= (pour-time can3) 12)
    (sealed can4) (= (pour-rate can4) 3) (= (pour-time can4) 12)
    (sealed can5) (= (pour-rate can5) 3) (= (pour-time can5) 12)
    (sealed can6) (= (pour-rate can6) 3) (= (pour-time can6) 12)
    (sealed can7) (= (pour-rate can7) 3) (= (pour-time can7) 12)
    (sealed can8) (= (pour-rate can8) 3) (= (pour-time can8) 12)
  )

  (:goal (shift-done gen)))
