"""Which frequencies of a log are kept, and the filter that keeps them."""
