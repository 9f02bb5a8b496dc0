"""`robust pike`: from options to answers about plans with choices."""
