"""Candidate causes as columns of a linear regression: tried without fitting a model."""
