"""The probability that a plan succeeds when parameters are random, as certified bounds, and boxes that keep most."""
