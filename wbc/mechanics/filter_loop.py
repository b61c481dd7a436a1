"""A filter forward and backward, compiled: import where needed.

`scipy.signal.sosfilt` takes longer to begin than these short columns take to filter, and a model
with links behind gears is filtered some hundred thousand times.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutDense, compiled


@compiled
def filter_both_ways(sections: Dense, steady: Dense, values: OutDense) -> None:
    """Filter columns (N, k) in place, forward and then backward.

    Each pass begins as if its first value had lasted for ever.

    Args:
        sections: (s, 6) second-order sections as of `scipy.signal.butter`.
        steady: (s, 2) their states under a steady input of one, as of `scipy.signal.sosfilt_zi`.
        values: (N, k) to change.
    """
    rows, columns = values.shape
    begun, one, two = np.empty(columns), np.empty(columns), np.empty(columns)
    for backward in range(2):
        for k in range(columns):
            begun[k] = values[(rows - 1) * backward, k]
        for s in range(sections.shape[0]):
            b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
            a1, a2 = sections[s, 4], sections[s, 5]
            for k in range(columns):
                one[k], two[k] = steady[s, 0] * begun[k], steady[s, 1] * begun[k]
            for i in range(rows):
                at = rows - 1 - i if backward else i
                for k in range(columns):
                    x = values[at, k]
                    y = b0 * x + one[k]
                    one[k] = b1 * x - a1 * y + two[k]
                    two[k] = b2 * x - a2 * y
                    values[at, k] = y
