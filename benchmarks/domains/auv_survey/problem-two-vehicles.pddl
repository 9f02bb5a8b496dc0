; Two vehicles and one berth: whoever is back first recharges first.

(define (problem three_sites_one_berth)
  (:domain auv_survey)

  (:objects
    nereid triton - vehicle
    pontoon - dock
    reef wreck vent - site)

  (:init
    (at nereid pontoon)
    (at triton pontoon)
    (berth-free pontoon)
    (accessible reef)
    (at 110 (not (accessible reef)))
    (at 40 (accessible vent))
    (at 150 (not (accessible vent)))
    (at 180 (accessible wreck))
    (at 300 (not (accessible wreck)))
    (ship-waiting)
    (at 420 (not (ship-waiting)))
    (= (charge nereid) 140)
    (= (full nereid) 240)
    (= (reserve nereid) 20)
    (= (charge triton) 200)
    (= (full triton) 200)
    (= (reserve triton) 30))

  (:goal (and
    (surveyed reef)
    (surveyed wreck)
    (surveyed vent)
    (>= (charge triton) 150)
    (recovered nereid))))
