; A workshop: parts are cut, painted and packed; there is one saw and one paint booth.
(define (domain workshop)
  (:requirements :typing :durative-actions :fluents)
  (:types worker part)
  (:predicates (free ?w - worker) (saw) (booth) (raw ?p - part) (cut ?p - part) (painted ?p - part) (packed ?p - part))
  (:functions (cutting ?p - part) (painting ?p - part) (packing ?p - part))
  (:durative-action saw
    :parameters (?w - worker ?p - part)
    :duration (= ?duration (cutting ?p))
    :condition (and (at start (free ?w)) (at start (saw)) (at start (raw ?p)))
    :effect (and (at start (not (free ?w))) (at end (free ?w)) (at start (not (saw))) (at end (saw))
                 (at start (not (raw ?p))) (at end (cut ?p))))
  (:durative-action paint
    :parameters (?w - worker ?p - part)
    :duration (= ?duration (painting ?p))
    :condition (and (at start (free ?w)) (at start (booth)) (at start (cut ?p)))
    :effect (and (at start (not (free ?w))) (at end (free ?w)) (at start (not (booth))) (at end (booth))
                 (at start (not (cut ?p))) (at end (painted ?p))))
  (:durative-action pack
    :parameters (?w - worker ?p - part)
    :duration (= ?duration (packing ?p))
    :condition (and (at start (free ?w)) (at start (painted ?p)))
    :effect (and (at start (not (free ?w))) (at end (free ?w)) (at start (not (painted ?p))) (at end (packed ?p)))))
