; The solar rover with an uncertain sun: what the panel yields per minute is a parameter of the whole domain.
; A rover gathers energy for one transmission: from a solar panel while the sun shines, and from cells that are discharged
; into its bus one at a time. Sources and transmitter share the bus, so one of them uses it at any time.

(define (domain solar_rover)
  (:requirements :typing :fluents :durative-actions :duration-inequalities :timed-initial-literals)

  (:types rover cell)

  (:synth-parameters ?yield)

  (:predicates
    (bus-free ?r - rover)
    (fresh ?c - cell)         ; not yet connected; a cell can be connected once
    (sunlit)
    (relay-above)             ; the orbiter that receives the data is in sight
    (panel-out ?r - rover)
    (transmitted ?r - rover))

  (:functions
    (stored ?r - rover)       ; energy in the bus capacitor
    (capacity ?r - rover)
    (needed ?r - rover)       ; stored energy before a transmission may begin
    (left ?c - cell))

  (:durative-action unfold-panel
    :parameters (?r - rover)
    :duration (= ?duration 2)
    :condition (at start (bus-free ?r))
    :effect (at end (panel-out ?r)))

  (:durative-action harvest
    :parameters (?r - rover)
    :duration (>= ?duration 1)
    :condition (and
      (at start (bus-free ?r))
      (at start (panel-out ?r))
      (over all (sunlit))
      (over all (<= (stored ?r) (capacity ?r))))
    :effect (and
      (at start (not (bus-free ?r)))
      (increase (stored ?r) (* #t ?yield))
      (at end (bus-free ?r))))

  (:durative-action discharge
    :parameters (?r - rover ?c - cell)
    :duration (>= ?duration 1)
    :condition (and
      (at start (bus-free ?r))
      (at start (fresh ?c))
      (over all (>= (left ?c) 0))
      (over all (<= (stored ?r) (capacity ?r))))
    :effect (and
      (at start (not (bus-free ?r)))
      (at start (not (fresh ?c)))
      (decrease (left ?c) (* #t 7))       ; one seventh is lost as heat
      (increase (stored ?r) (* #t 6))
      (at end (bus-free ?r))))

  (:durative-action transmit
    :parameters (?r - rover)
    :duration (= ?duration 20)
    :condition (and
      (at start (bus-free ?r))
      (at start (>= (stored ?r) (needed ?r)))
      (over all (relay-above))
      (over all (>= (stored ?r) 0)))
    :effect (and
      (at start (not (bus-free ?r)))
      (decrease (stored ?r) (* #t 12))
      (at end (bus-free ?r))
      (at end (transmitted ?r)))))
