"""The bodies of a scene: links, ground, terrain, and their shapes."""
