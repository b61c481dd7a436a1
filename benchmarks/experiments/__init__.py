"""Judge designed experiments on the tied cases of the corpus."""
