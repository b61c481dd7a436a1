"""The tree of rigid bodies in compiled loops: places, inertia, velocity terms, free bases."""
