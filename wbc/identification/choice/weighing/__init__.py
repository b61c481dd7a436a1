"""Hypotheses, their fits, and how probable they are: evidence, prior, odds, certainty."""
