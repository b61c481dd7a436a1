"""Files of columns: opening, reading in pieces, writing."""
