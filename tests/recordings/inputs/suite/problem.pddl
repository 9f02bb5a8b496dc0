; Times are minutes after the rover may leave its base. The ridge lies in the sun from 21 to 61, the crater from 73 on,
; night falls at 129. The way up from the ridge to the crater's rim takes twice the charge per minute.

(define (problem two_samples_before_nightfall)
  (:domain two_sample_navigation)

  (:objects
    scout - rover
    base ridge crater - site)

  (:init
    (at scout base)
    (daylight)
    (at 21 (lit ridge))
    (at 61 (not (lit ridge)))
    (at 73 (lit crater))
    (at 129 (not (daylight)))
    (= (charge scout) 170)
    (= (reserve scout) 10)
    (= (drain base ridge) 1)
    (= (drain ridge crater) 2)
    (= (drain crater base) 1))

  (:goal (and
    (sampled ridge)
    (sampled crater)
    (at scout base))))
