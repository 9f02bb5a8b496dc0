(define (domain Rich) ; Comments (end with the line
 (:requirements :typing :durative-actions :fluents)
 (:types truck ship - vehicle place vehicle - object crate
  - object box - crate)
 (:constants Depot - place)
 (:synth-parameters ?limit)
 (:predicates (at ?v - vehicle ?p - place) (in ?c - crate ?w - (either vehicle place)) (busy) (big ?c) (z)
  (in_place ?c))
 (:functions (fuel ?v - vehicle) (level) (rate) - number (cost) - number (toll ?v - vehicle))
 (:durative-action move
  :parameters (?v - vehicle ?from ?to - place)
  (:synth-parameters ?slack ?more)
  :duration (and (>= ?duration ?slack) (at end (<= ?duration (+ (rate) 2 ?limit))))
  :condition (and
   (at start (at ?v ?from)) (over all (and (not (busy)) (>= (fuel ?v) 0))) (at start (not (= ?from ?to)))
   (forall (?c - crate) (at end (imply (big ?c) (in_vehicle ?c ?v)))))
  :effect (and
   (at start (not (at ?v ?from))) (at end (and (at ?v ?to) (scale-down (level) 2)))
   (decrease (fuel ?v) (* #t (rate))) (increase (cost) (* (+ ?slack (toll ?v)) #t))
   (forall (?c - box) (when (at start (in ?c ?v)) (at start (not (big ?c)))))
   (at end (when (> (- level 1) -3) (forall (?p ?q - place) (when (not (= ?p ?q)) (assign (cost)
     (- (* 2 level ?duration))))))))
 )
 (:action mark
  :parameters (?c - (either box place) ?d)
  :synth-parameters ?much
  :precondition (and (or (busy) (< 1 ?much)) (exists (?v - truck) (in ?c ?v)) () (= ?c ?d))
  :effect (and (when (busy) (decrease level (/ 1 3))) (not (busy)) (scale-up (rate) (+ 3)) ()))
 (:action rest :parameters (?x ?y) :synth-parameters ?z :precondition () :effect (and)))
