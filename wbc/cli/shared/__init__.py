"""Options, loading and writing that several commands share."""
