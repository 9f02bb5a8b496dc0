(define (domain d) (:types lamp) (:predicates (lit ?l - lamp)) (:functions (level)) (:synth-parameters ?s)
 (:action outer :effect (assign (level) ?s))
 (:action lamp :parameters (?s - lamp) :effect (lit ?s))
 (:action own :synth-parameters (?s) :effect (assign (level) ?s)))
