"""From `robot.toml` and a model file to a robot: tables, units, poses, solids."""
