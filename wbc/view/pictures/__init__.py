"""Pictures and films of a playback, taken without a display."""
