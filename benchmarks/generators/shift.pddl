; A shift of a generating set that needs {refuels} canisters besides the fuel in its tank.

(define (problem shift_with_{refuels}_canisters)
  (:domain generating_set)

  (:objects
    gen - genset
    {names} - canister)

  (:init
    (= (fuel gen) 50)
    (= (tank-size gen) 70)
    (= (burn-rate gen) 1)
    (= (shift-length gen) {length})
{filled}
  )

  (:goal (shift-done gen)))
