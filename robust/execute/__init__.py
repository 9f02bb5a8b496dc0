"""From a planner's time-triggered plan to a flexible, proved temporal network, and on to its execution."""
