"""Many runs: tasks done once each, here or on a cluster, and kept; whole processes, measured; suites of plans."""
