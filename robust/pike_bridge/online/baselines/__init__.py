"""What PIKE is compared with: executives that guess intents (Kirk), or that reason about time only (Drake)."""
