"""One step of the plant: from forces and gear laws to the state after it."""
