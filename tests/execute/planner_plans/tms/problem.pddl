(define (problem pfile1) (:domain domain-tms-2-3)
 (:objects kiln0 - kiln8 p0 - piece1)
 (:init (energy))
 (:goal (and (baked p0) (treated p0))))
