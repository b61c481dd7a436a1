"""Tasks, contacts and limits, the two QPs, and the whole-body controller."""
