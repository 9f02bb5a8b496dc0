"""The theorems: one module each, with its problem in SMT-LIB 2, its broken variants and its countermodels."""
