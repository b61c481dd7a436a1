"""What happens between rotor and joint: losses, springs and play of a gear."""
