"""Compare a robot with logs, diagnose what it lacks, add it, verify."""
