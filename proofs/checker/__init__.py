"""The checker of certificates: standard library only, no solver, nothing of `robust`.

Read it in this order: what the files say (`reader`), what breaks a plan (`formulas`), what a certificate may say and why
it is believed (`proofs`), what follows for boxes and regions (`claims`), plans with choices (`choices`), the command.
"""
