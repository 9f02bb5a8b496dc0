"""The exact robustness envelope: elimination back ends, and the regions of parameter space that they return."""
