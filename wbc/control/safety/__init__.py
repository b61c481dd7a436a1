"""What a tick is told, what stands in its way, and what is commanded then."""
