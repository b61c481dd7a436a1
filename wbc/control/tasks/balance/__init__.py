"""Tasks that keep the robot from falling."""
