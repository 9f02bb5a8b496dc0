; One vehicle, two sites: the charge does not suffice for both, so it has to return to the dock in between.

(define (problem reef_and_wreck)
  (:domain auv_survey)

  (:objects
    nereid - vehicle
    pontoon - dock
    reef wreck - site)

  (:init
    (at nereid pontoon)
    (berth-free pontoon)
    (at 30 (accessible reef))
    (at 120 (not (accessible reef)))
    (at 200 (accessible wreck))
    (at 300 (not (accessible wreck)))
    (ship-waiting)
    (at 400 (not (ship-waiting)))
    (= (charge nereid) 160)
    (= (full nereid) 240)
    (= (reserve nereid) 20))

  (:goal (and
    (surveyed reef)
    (surveyed wreck)
    (recovered nereid))))
