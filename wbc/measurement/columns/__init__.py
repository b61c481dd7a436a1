"""From foreign columns to the channels of a log: maps, units, sides of the gear, rows."""
