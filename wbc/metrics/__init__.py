"""Inertia tensors, force capability and impact mitigation of lossy legs."""
