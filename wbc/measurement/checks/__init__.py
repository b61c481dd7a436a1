"""What a log is good for, found before anything is computed from it."""
