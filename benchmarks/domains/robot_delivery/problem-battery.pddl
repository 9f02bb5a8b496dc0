; One order with batteries: bob's is old.

(define (problem one_order_battery)
  (:domain robot_delivery_battery)

  (:objects
    ada bob - robot
    depot shelf station rings gate - place
    first - order
    housing bearing cap - step
    red - ring)

  (:init
    (at ada depot)
    (at bob depot)
    (hands-free ada)
    (hands-free bob)
    (is-shelf shelf)
    (is-base-station station)
    (is-ring-station rings)
    (is-gate gate)
    (ring-of first red)
    (on-top first red red)
    (order-open first)
    (at 420 (not (order-open first)))
    (= (battery ada) 100)
    (= (battery bob) 20)
    (= (distance depot shelf) 30)
    (= (distance shelf station) 20)
    (= (distance depot station) 40)
    (= (distance station rings) 25)
    (= (distance rings gate) 35)
    (= (distance gate shelf) 50)
    (= (distance station shelf) 20)
    (= (distance depot gate) 60)
    (= (step-time housing) 60)
    (= (step-time bearing) 70)
    (= (step-time cap) 50))

  (:goal (delivered first)))
