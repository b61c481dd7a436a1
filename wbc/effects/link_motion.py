"""The motion of a link behind a soft gear with play, driven by the measured motion of its motor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import LinkResponse

_STEP = 5e-4  # [s]


def link_deflection(
    response: LinkResponse, stiffness: float, damping: float, backlash: float
) -> FloatArray:
    """Return the deflection of the link (N, 3): position, rate, second derivative.

    inertia d_dd + damping d_d + stiffness d + load = -k dz(d) - c d_d while in contact, with the
    dead zone dz of width `backlash`; contact is implicit, so any stiffness is stable. It starts
    at rest in contact.

    Args:
        response: of the link along a log.
        stiffness: k of the contact [N m/rad].
        damping: c of the contact [N m s/rad].
        backlash: whole free play [rad].
    """
    row = response.row
    load = response.load[:, row].tolist()
    inertia = response.inertia[:, row].tolist()
    drag = response.damping[:, row].tolist()
    pull = response.stiffness[:, row].tolist()
    parts = max(1, round(response.step / _STEP))
    h = response.step / parts
    half = 0.5 * backlash
    d = -load[0] / stiffness - (half if load[0] > 0.0 else -half)
    v = 0.0
    result = np.zeros((len(load), 3))
    for k in range(len(load) - 1):
        m, b, p = inertia[k], drag[k], pull[k]
        slope = (load[k + 1] - load[k]) / parts
        torque = load[k]
        result[k, 0], result[k, 1] = d, v
        for _ in range(parts):
            torque += slope
            if d > half:
                v = (m * v - h * (torque + p * d + stiffness * (d - half))) / (
                    m + h * (b + damping + h * stiffness)
                )
            elif d < -half:
                v = (m * v - h * (torque + p * d + stiffness * (d + half))) / (
                    m + h * (b + damping + h * stiffness)
                )
            else:
                v -= h * (torque + p * d + b * v) / m
            d += h * v
    result[-1] = d, v, 0.0
    # Averaged over the two neighbouring intervals, so that it belongs to the sample's own time.
    result[:, 2] = np.gradient(result[:, 1], response.step)
    return result


def best_contacts(
    responses: Sequence[LinkResponse],
    torques: Sequence[FloatArray],
    contacts: FloatArray,
    count: int,
    duration: float = 3.0,
) -> FloatArray:
    """Return the `count` rows of `contacts` whose deflection explains a torque best.

    None is returned for a link without inertia about the joint (modelled as a point on its axis):
    nothing would swing behind the gear. All contacts on all logs are integrated side by side, over
    the seconds of each log in which most is unexplained.

    Args:
        responses: of the joint, one per log.
        torques: (N, nv) unexplained, one per log.
        contacts: (P, 3) stiffness, damping, backlash.
        count: how many to return, best first.
        duration: [s] of each log to use.
    """
    row, step = responses[0].row, responses[0].step
    if min(float(np.min(response.inertia[:, row])) for response in responses) <= 0.0:
        return contacts[:0]
    length = min(int(duration / step), *(len(torque) for torque in torques))
    starts = [_busiest(torque[:, row], length) for torque in torques]
    parts = [slice(start, start + length) for start in starts]

    def column(name: str) -> FloatArray:
        pairs = zip(responses, parts, strict=True)
        return np.stack([getattr(r, name)[part, row] for r, part in pairs], axis=1)

    wanted = np.stack([t[part, row] for t, part in zip(torques, parts, strict=True)], axis=1)
    found = _side_by_side(
        column("load"),
        column("inertia"),
        column("damping"),
        column("stiffness"),
        contacts,
        step,
    )
    explained = np.einsum("nl,npl->p", wanted, found)
    power = np.sum(found**2, axis=(0, 2))
    gain = np.where(power > 0.0, 2.0 * explained - power, -np.inf)
    return np.asarray(contacts[np.argsort(gain)[::-1][:count]])


def _busiest(torque: FloatArray, length: int) -> int:
    """Return where the window of `length` samples with the largest torque starts."""
    total = np.concatenate([[0.0], np.cumsum(torque**2)])
    return int(np.argmax(total[length:] - total[:-length]))


def _side_by_side(
    load: FloatArray,
    inertia: FloatArray,
    drag: FloatArray,
    pull: FloatArray,
    contacts: FloatArray,
    step: float,
) -> FloatArray:
    """Return the joint's additional torque (N, P, L) for every contact on L logs, (N, L) each."""
    stiffness, damping, backlash = (c[:, None] for c in contacts.T)
    half = 0.5 * backlash
    parts = max(1, round(step / (2.0 * _STEP)))
    h = step / parts
    d = -load[0] / stiffness - np.sign(load[0]) * half
    v = np.zeros(d.shape)
    result = np.zeros((len(load), *d.shape))
    for k in range(len(load) - 1):
        m, b, p = inertia[k], drag[k], pull[k]
        slope = (load[k + 1] - load[k]) / parts
        start = v
        for part in range(parts):
            play = d - np.clip(d, -half, half)
            push = load[k] + slope * (part + 1) + p * d + stiffness * play
            v = (m * v - h * push) / (m + h * b + (play != 0.0) * (h * damping + h * h * stiffness))
            d = d + h * v
        result[k] = m * (v - start) / step + b * v + p * d
    return result
