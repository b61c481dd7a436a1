"""A robot with effects held against rows: residual, derivatives, fit, intervals."""
