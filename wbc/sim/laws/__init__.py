"""The laws of gears and friction in one time step, and what makes up their rows."""
