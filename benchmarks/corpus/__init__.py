"""A frozen corpus of generated cases with known truth, and the scorecard of the diagnosis on it."""
