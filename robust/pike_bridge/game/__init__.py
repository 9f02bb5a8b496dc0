"""Plans with choices as games: rules, strategies for all lengths and choices, and who follows them."""
