"""PDDL: text to words, declarations, typed syntax, ground actions, and back to text."""
