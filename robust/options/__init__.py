"""Options, each declared once: name, type, default, help, and what it may be combined with."""
