"""Recordings that move: the page that plays one, the live window, the ghost of the model."""
