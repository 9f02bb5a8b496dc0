"""Boxes of parameter values inside the robustness envelope: containment, and the searches for large ones."""
