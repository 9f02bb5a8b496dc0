"""Results as text and JSON: what renders imports what is rendered, never back."""
