"""Results as text, JSON, pictures and pages: what renders imports what is rendered, never back."""
