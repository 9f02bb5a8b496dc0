; The sun shines from minute 10 to 55; the relay is above from minute 60 to 100.

(define (problem one_pass_of_the_relay)
  (:domain solar_rover)

  (:objects
    helio - rover
    cell1 cell2 cell3 - cell)

  (:init
    (bus-free helio)
    (fresh cell1)
    (fresh cell2)
    (fresh cell3)
    (at 10 (sunlit))
    (at 55 (not (sunlit)))
    (at 60 (relay-above))
    (at 100 (not (relay-above)))
    (= (stored helio) 20)
    (= (capacity helio) 320)
    (= (needed helio) 250)
    (= (sun-yield helio) 4)
    (= (left cell1) 84)
    (= (left cell2) 77)
    (= (left cell3) 70))

  (:goal (transmitted helio)))
