"""The experiments about plans with choices: the figures of [PIKE], and the executives it is compared with."""
