"""Domains, generators and drivers that reproduce the experiments."""
