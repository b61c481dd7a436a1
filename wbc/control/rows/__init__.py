"""What asks for motion and forces: tasks, efforts, contacts and limits, and their rows."""
