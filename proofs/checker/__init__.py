"""The checker of certificates: standard library only, no solver, nothing of `robust`.

In the order of reading: what the files say (`reader`), what breaks a plan (`formulas`), what a certificate may say and
why it is believed (`proofs`), what follows for boxes and regions (`claims`), for plans with choices (`choices`).
"""
