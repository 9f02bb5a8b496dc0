"""Certificates: why a verdict holds, in a form that a small program can check without any solver."""
