(define (problem rib)
  (:domain wing)
  (:init
    (on-table pliers)
    (on-table cleco1)
    (on-table cleco2)
  )
  (:goal (and (fastened cleco1) (fastened cleco2)))
)
