; Two robots, two orders: the nearer one is quicker (one ring, closes at 420 seconds), the other has three rings (closes at 760).

(define (problem two_orders)
  (:domain robot_delivery)

  (:objects
    ada bob - robot
    depot shelf station rings gate - place
    first second - order
    housing bearing cap - step
    red green blue - ring)

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
    (ring-of second green)
    (ring-of second blue)
    (ring-of second red)
    (on-top second green green)
    (on-top second green blue)
    (on-top second blue red)
    (order-open first)
    (at 420 (not (order-open first)))
    (order-open second)
    (at 760 (not (order-open second)))
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

  (:goal (and
    (delivered first)
    (delivered second))))
