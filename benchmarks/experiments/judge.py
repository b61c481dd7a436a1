"""Whether a follow-up left only what is right, and shares with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from wbc.identification.choice.certainty import TIED

Result = dict[str, Any]


def kept(nats: Sequence[float]) -> tuple[bool, tuple[int, ...]]:
    """Return whether a diagnosis keeps the true cause, and the rivals that it keeps.

    It keeps what lies within `TIED` nats of the best.

    Args:
        nats: evidence of the true cause beyond that of each rival.
    """
    best = max(0.0, *(-n for n in nats))
    rivals = tuple(k for k, n in enumerate(nats) if -n > best - TIED)
    return best < TIED, rivals


def settled(nats: Sequence[float], attainable: Mapping[str, float]) -> bool:
    """Whether the names kept hold the truth, and no motion speaks against the others kept.

    Args:
        nats: evidence of the true cause beyond that of each rival.
        attainable: number of a rival -> nats that the best motion for the two is expected to bring.
    """
    true, rivals = kept(nats)
    return true and all(attainable[str(k)] < TIED for k in rivals)


def share(hits: Sequence[bool]) -> str:
    """Return a share with its 90 % interval (Wilson)."""
    if not hits:
        return "no case"
    test = binomtest(int(np.sum(hits)), len(hits))
    low, high = test.proportion_ci(0.9, method="wilson")
    return f"{100 * np.mean(hits):4.0f} % ({100 * low:3.0f} to {100 * high:3.0f}) of {len(hits)}"
