"""What sensors make of a recording."""
