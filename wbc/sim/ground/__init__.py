"""What the robot stands on and stops at: grounds, contact rows, joint limits."""
