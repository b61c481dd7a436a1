"""Which gears that yield explain logs: simulated links follow no linear screen."""
