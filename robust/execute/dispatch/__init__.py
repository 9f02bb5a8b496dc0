"""Dispatch of parametrized plans under a box of parameter values [IRR §3, Algorithm 2]."""
