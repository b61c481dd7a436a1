"""Rows of the torque limits, compiled: one per gear, or two where directions are searched."""

from __future__ import annotations

from numba import types

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Flag,
    Flags,
    Matrix,
    Nothing,
    Number,
    OutDense,
    OutFlags,
    OutMatrix,
    OutRow,
    OutVector,
    Places,
    Row,
    Vector,
    compiled,
)
from wbc.control.solvers.problem import INFINITE


@compiled(Nothing, Dense, Dense, Number, Count, Count, OutMatrix)
def _place_row(
    torque_map: FloatArray, rotor: FloatArray, slope: float, gear: int, row: int, C: FloatArray
) -> None:
    """Write slope * torque_map + rotor of one gear into a row (n,) of C."""
    for j in range(torque_map.shape[1]):
        C[row, j] = slope * torque_map[gear, j]
    for j in range(rotor.shape[1]):
        C[row, j] += rotor[gear, j]


@compiled(Nothing, Dense, Row, Matrix, Number, Places, Dense, Count, OutDense, OutRow)
def place_torque_map(
    mass: FloatArray,
    bias: FloatArray,
    jacobian: FloatArray,
    scale: float,
    driven: IntArray,
    topology: FloatArray,
    serial: int,
    torque_map: FloatArray,
    output_bias: FloatArray,
) -> None:
    """Write T = D' (M qdd + bias - scale J' f)_driven as a map (m, n) and its constant part (m,).

    Args:
        mass, bias, jacobian, scale, driven, topology: as for `place_output`.
        serial: 1 where D is the identity.
        torque_map, output_bias: results.
    """
    nv, m = len(bias), len(driven)
    for gear in range(m):
        output_bias[gear] = 0.0
        for j in range(torque_map.shape[1]):
            torque_map[gear, j] = 0.0
        for i in range(m):
            share = topology[i, gear]
            if share == 0.0 or (serial == 1 and i != gear):
                continue
            row = driven[i]
            output_bias[gear] += share * bias[row]
            for j in range(nv):
                torque_map[gear, j] += share * mass[row, j]
            for k in range(len(jacobian)):
                torque_map[gear, nv + k] -= scale * share * jacobian[k, row]


@compiled(
    Nothing,
    *(Dense, Dense, Vector, Vector, Places, Vector, Vector, Vector),
    *(OutMatrix, OutVector, OutVector),
)
def place_torque_rows(
    torque_map: FloatArray,
    rotor: FloatArray,
    output_bias: FloatArray,
    rotor_bias: FloatArray,
    gears: IntArray,
    slopes: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    C: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> None:
    """Write lower <= slope T + rotor qdd + rotor_bias <= upper of the gears that have a limit.

    Args:
        torque_map: (m, n), T = torque_map @ x + output_bias.
        rotor: (m, nv).
        output_bias, rotor_bias: (m,) [N m].
        gears: numbers of the gears that have a limit (g,).
        slopes: e (m,).
        lower, upper: least and greatest N tau_phi (m,) [N m].
        C, low, high: results (g, n), (g,), (g,).
    """
    for row in range(len(gears)):
        i = gears[row]
        _place_row(torque_map, rotor, slopes[i], i, row, C)
        offset = slopes[i] * output_bias[i] + rotor_bias[i]
        low[row], high[row] = lower[i] - offset, upper[i] - offset


@compiled(
    Nothing,
    *(Dense, Dense, Vector, Vector, Places, Vector, Vector, Vector, Vector, Vector),
    *(OutMatrix, OutVector, OutVector) * 2,
)
def place_directed_rows(
    torque_map: FloatArray,
    rotor: FloatArray,
    output_bias: FloatArray,
    rotor_bias: FloatArray,
    gears: IntArray,
    positive: FloatArray,
    negative: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    choice: FloatArray,
    C: FloatArray,
    low: FloatArray,
    high: FloatArray,
    more_C: FloatArray,
    more_low: FloatArray,
    more_high: FloatArray,
) -> None:
    """Write the convex rows of all gears, and one half-space of some.

    N tau_phi is convex in T where positive >= negative: its upper limit is then two rows, its
    lower one a union. In a gear that turns the other way it is the reverse.

    Args:
        torque_map, rotor, output_bias, rotor_bias, gears, lower, upper: as for
            `place_torque_rows`.
        positive, negative: slopes (m,) for either sign of T.
        choice: (m,) 1 where the half-space is that of T > 0, -1 where that of T < 0, 0 where
            there is none.
        C, low, high: results for T < 0, as for `place_torque_rows`.
        more_C, more_low, more_high: results for T > 0.
    """
    for row in range(len(gears)):
        i = gears[row]
        convex = positive[i] >= negative[i]
        least = -INFINITE if convex else lower[i]
        most = upper[i] if convex else INFINITE
        _place_row(torque_map, rotor, negative[i], i, row, C)
        offset = negative[i] * output_bias[i] + rotor_bias[i]
        own = choice[i] < 0.0
        low[row] = (lower[i] if own else least) - offset
        high[row] = (upper[i] if own else most) - offset
        _place_row(torque_map, rotor, positive[i], i, row, more_C)
        offset = positive[i] * output_bias[i] + rotor_bias[i]
        own = choice[i] > 0.0
        more_low[row] = (lower[i] if own else least) - offset
        more_high[row] = (upper[i] if own else most) - offset


@compiled(Nothing, *[Row] * 2, *[Vector] * 4, OutFlags)
def place_beyond(
    output: FloatArray,
    share: FloatArray,
    positive: FloatArray,
    negative: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    beyond: BoolArray,
) -> None:
    """Write which gears (m,) give more than their limits by the mesh law.

    Args:
        output, share: T and what the rotors take themselves (m,) [N m].
        positive, negative: slopes (m,) for either sign of T.
        lower, upper: least and greatest N tau_phi (m,) [N m].
        beyond: result (m,).
    """
    for i in range(len(output)):
        torque = (positive[i] if output[i] > 0.0 else negative[i]) * output[i] + share[i]
        slack = 1e-5 * (1.0 + abs(torque))
        beyond[i] = torque < lower[i] - slack or torque > upper[i] + slack


@compiled(
    types.UniTuple(Flag, 2),
    *(Row, Flags, Vector, Vector, Flags, Places, Row, Flag, Number, Number),
    *(OutFlags, OutFlags),
)
def place_doubtful(
    output: FloatArray,
    beyond: BoolArray,
    positive: FloatArray,
    negative: FloatArray,
    guessed: BoolArray,
    gears: IntArray,
    push: FloatArray,
    always: bool,
    small: float,
    active: float,
    turned: BoolArray,
    contested: BoolArray,
) -> tuple[bool, bool]:
    """Write which gears (m,) turn the other way than guessed, and which could turn either way.

    A wrong guess counts where the gear is beyond its limits or pushes at them. At a limit that is
    a union of half-spaces, one per direction, the other direction might be better.

    Args:
        output: T (m,) of a solution.
        beyond: (m,) gears beyond their limits by the mesh law.
        positive, negative: slopes (m,) for either sign of T.
        guessed: (m,) where T > 0 was guessed.
        gears: numbers of the gears that have a limit (g,).
        push: multipliers (g,) of the limits' rows.
        always: whether every wrong guess counts.
        small: [N m] up to which an output torque has no direction.
        active: push from which a row binds.
        turned, contested: results.

    Returns:
        whether there are any of either.
    """
    turned[:], contested[:] = False, False
    any_turned, any_contested = False, False
    for row in range(len(gears)):
        i = gears[row]
        convex, concave = positive[i] > negative[i], positive[i] < negative[i]
        contested[i] = (convex and push[row] < -active) or (concave and push[row] > active)
        any_contested = any_contested or contested[i]
        turned[i] = abs(push[row]) > active
    for i in range(len(output)):
        wrong = (output[i] > 0.0) != guessed[i] and positive[i] != negative[i]
        turned[i] = wrong and abs(output[i]) > small and (always or beyond[i] or turned[i])
        any_turned = any_turned or turned[i]
    return any_turned, any_contested


@compiled(Nothing, *[Row] * 3, *[Vector] * 4, Places, OutRow)
def place_target(
    output: FloatArray,
    share: FloatArray,
    x: FloatArray,
    positive: FloatArray,
    negative: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    gears: IntArray,
    target: FloatArray,
) -> None:
    """Write x (n,) scaled down until no gear needs more than the greater of its limits.

    Args:
        output, share: T and what the rotors take themselves (m,) [N m] at x.
        x: (n,).
        positive, negative: slopes (m,) for either sign of T.
        lower, upper: least and greatest N tau_phi (m,) [N m].
        gears: numbers of the gears that have a limit (g,).
        target: result.
    """
    least = 1.0
    for row in range(len(gears)):
        i = gears[row]
        torque = (positive[i] if output[i] > 0.0 else negative[i]) * output[i] + share[i]
        limit = max(abs(lower[i]), abs(upper[i]))
        if abs(torque) > limit:
            least = min(least, limit / abs(torque))
    for j in range(len(x)):
        target[j] = least * x[j]
