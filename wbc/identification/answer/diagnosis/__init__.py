"""From logs to causes: findings, verdict, ranking, and how they are said."""
