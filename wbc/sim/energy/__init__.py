"""Work, losses and stored energy of steps."""
