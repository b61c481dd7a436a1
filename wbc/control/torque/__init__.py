"""Between output torques and motors: directions of power, stiction, limits."""
