"""How much of a residual is sensor noise."""
