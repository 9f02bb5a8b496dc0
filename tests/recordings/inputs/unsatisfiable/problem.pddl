(define (problem sat)
  (:domain sat)
  (:init
  )
  (:goal (and ))
)
