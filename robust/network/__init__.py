"""Networks of time points: difference constraints with their origins, and networks with uncertainty."""
