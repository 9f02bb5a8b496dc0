"""A domain and a problem that use every construct, for tests that need a valid text."""

DOMAIN = """; everything the reader knows
(define (domain Everything)
  (:requirements :adl :typing :durative-actions :continuous-effects :numeric-fluents)
  (:types robot truck - vehicle place vehicle - object cargo)
  (:constants Hub - place)
  (:synth-parameters ?speed)
  (:predicates (at ?v - vehicle ?p - place) (open ?p - place) (linked ?a ?b - place) (holds ?x - (either robot place))
    (busy))
  (:functions (charge ?v - vehicle) - number (distance ?a ?b - place) (drag) (total) - number)
  (:action toggle
    :parameters (?p - place)
    :precondition (and (not (busy)) (or (open ?p) (= ?p hub)) (> (total) -1.5))
    :effect (and (busy) (when (open ?p) (not (open ?p))) (forall (?v - robot) (assign (charge ?v) 1))))
  (:durative-action Move
    :parameters (?v - robot ?from ?to - place)
    :synth-parameters (?rate)
    :duration (and (>= ?duration (/ (distance ?from ?to) (drag))) (at end (<= ?duration (+ 1e2 ?speed))))
    :condition (and
      (at start (and (at ?v ?from) (or (linked ?from ?to) (linked ?to ?from)) (not (= ?from ?to))))
      (forall (?p - place) (and (over all (imply (open ?p) (holds ?v))) (at end (open ?p))))
      (at end (exists (?y - place) (and (not (= ?to ?y)) (not (>= (distance ?to ?y) .5)))))
      (over all (>= (charge ?v) (* ?duration ?rate))))
    :effect (and
      (at start (not (at ?v ?from)))
      (at end (at ?v ?to))
      (decrease (charge ?v) (* #t (/ ?rate 2)))
      (increase (total) #t)
      (forall (?p - place) (when (at start (open ?p)) (at start (not (open ?p)))))
      (at start (decrease (total) 3))
      (at end (when (busy) (and (not (busy)) (increase (total) ?duration)))))))
"""

PROBLEM = """(define (problem tour)
  (:domain EVERYTHING)
  (:objects R1 - robot a b - place)
  (:init (at r1 a) (linked a b) (not (busy)) (= (charge r1) 10.5) (= (drag) 2) (= total -1e-3)
    (= (distance a b) 8) (at 5.0 (open a)) (at 6 (not (open a))) (at 7 (= (charge r1) 3)))
  (:goal (and (at r1 b) (forall (?v - vehicle) (>= (charge ?v) ?speed))))
  (:metric minimize (+ total-time (total))))
"""
