"""Planners behind one interface: libraries of the extra `planners`, and any program by its command."""
