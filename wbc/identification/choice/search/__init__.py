"""From logs to the hypothesis that they speak for: moves, proposals, search."""
