"""From logs to rows: even clock, one band, weights, noise floor, folds."""
