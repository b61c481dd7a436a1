"""Tasks on the momentum of the whole robot."""
