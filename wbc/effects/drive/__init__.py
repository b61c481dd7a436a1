"""What a drive does with the torque it was asked for, and the inertia of its rotor."""
