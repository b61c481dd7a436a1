"""Which effects a robot lacks: hypotheses, evidence, search."""
