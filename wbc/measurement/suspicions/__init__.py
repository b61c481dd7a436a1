"""Wrong columns, signs, sides and units, found from the rows of logs before anything is fitted.

Each mistake that people make is a hypothesis with a mend: the lines of a column map that undo it.
The log as it stands and the log mended are held against what the robot needs for the motion; what
is suspected, and how surely, is the posterior probability of the mend.
"""
