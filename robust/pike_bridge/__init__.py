"""PIKE: temporal plans with choices shared by a robot and a human."""
