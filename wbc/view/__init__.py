"""Pictures: playback, plots and the report."""
