"""The simulator: contact, time step, impact, recording."""
