"""How links behind springs moved when a log began: what follows the log's gradient."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.links.response import LinkResponse
from wbc.transmission import Flanks

_SEEN = 1.0  # [rad] of its period that a swing may turn per sample and still be in a channel
_SLACK = 1e-9  # [N m/rad] below which a spring holds nothing


def shown(responses: Sequence[LinkResponse], paths: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Return what the torques at each of n joints show of B motions, in the band, (R, B) each.

    Args:
        responses: of the n links along one log.
        paths: of each link (N, 3 or 4, B): deflection, rate, second derivative, perhaps friction.
    """
    found = []
    for response in responses:
        parts = zip(responses, paths, strict=True)
        torques = [other.torque_on(response.row, path) for other, path in parts]
        found.append(response.band(np.sum(torques, axis=0)))
    return tuple(found)


def chosen_start(
    responses: Sequence[LinkResponse],
    gears: Sequence[Flanks],
    left: FloatArray,
    columns: FloatArray,
    begun: FloatArray,
) -> FloatArray:
    """Return the likeliest start of n links, deflections and then rates (2 n,).

    Args:
        responses: of the links along one log.
        gears: in front of them.
        left: (R,) what the motion from `begun` leaves unexplained at the joints.
        columns: (R, 2 n) what unit changes of the start show.
        begun: a start (2 n,).
    """
    pairs = list(zip(responses, gears, strict=True))
    seen = np.array([r.step * own_frequency(r, gear) < _SEEN for r, gear in pairs] * 2)
    typical = np.transpose([typical_start(r, gear) for r, gear in pairs]).ravel()
    start = np.array(begun)
    if seen.any():
        wanted = left + columns[:, seen] @ begun[seen]
        start[seen] = likely_start(columns[:, seen], wanted, typical[seen])
    return start


def typical_start(response: LinkResponse, gear: Flanks) -> FloatArray:
    """Return the deflection [rad] to which the largest load winds up a gear, and its rate, (2,)."""
    largest = float(np.max(np.abs(response.load[:, response.row])))
    return largest / _pull(gear) * np.array([1.0, own_frequency(response, gear)])


def likely_start(columns: FloatArray, wanted: FloatArray, typical: FloatArray) -> FloatArray:
    """Return the start (n,) that leaves least of `wanted`, starts being as large as is typical.

    A swing that dies down before the first sample that is judged is in no channel: a start of any
    size would write its last trace into the noise.

    Args:
        columns: (R, n) what unit starts add.
        wanted: (R,) what no start explains of it is the noise against which starts are weighed.
        typical: (n,) standard deviations that are expected of starts.
    """
    scaled = columns * typical
    any_size = np.linalg.lstsq(scaled, wanted, rcond=None)[0]
    scatter = float(np.sqrt(np.mean((wanted - scaled @ any_size) ** 2)))
    rows = np.concatenate([scaled, scatter * np.eye(typical.size)])
    aims = np.concatenate([wanted, np.zeros(typical.size)])
    return np.asarray(typical * np.linalg.lstsq(rows, aims, rcond=None)[0])


def own_frequency(response: LinkResponse, gear: Flanks) -> float:
    """Return the angular frequency [rad/s] at which a link swings behind a spring."""
    inertia = float(np.mean(response.inertia[:, response.row]))
    return float(np.sqrt(_pull(gear) / inertia))


def _pull(gear: Flanks) -> float:
    return max(gear.stiffness, _SLACK)
