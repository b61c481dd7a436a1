"""Position servos: fits of rollouts to their runs."""
