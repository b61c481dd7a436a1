"""What the controller believes of gears near standstill, compiled."""

from __future__ import annotations

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Dense,
    Flag,
    Matrix,
    Nothing,
    Number,
    OutDense,
    OutRow,
    OutVector,
    Places,
    Row,
    Vector,
    compiled,
)
from wbc.control.program.balance import place_output


@compiled(Nothing, Vector, Vector, Number, Number, OutVector)
def place_corrected(
    expected: FloatArray, measured: FloatArray, trusted: float, kept: float, corrected: FloatArray
) -> None:
    """Write measured - kept clip(measured - expected, +-trusted) (k,) into `corrected`."""
    for i in range(len(measured)):
        error = min(max(measured[i] - expected[i], -trusted), trusted)
        corrected[i] = measured[i] - kept * error


@compiled(Nothing, Vector, Number, OutVector)
def place_certainty(speed: FloatArray, full: float, certainty: FloatArray) -> None:
    """Write clip(speed / full, +-1) (k,) into `certainty`."""
    for i in range(len(speed)):
        certainty[i] = min(max(speed[i] / full, -1.0), 1.0)


@compiled(
    Nothing,
    *(Vector, Vector, *[Number] * 3, Places, Matrix),
    *[OutVector] * 4,
)
def place_judged(
    expected: FloatArray,
    measured: FloatArray,
    trusted: float,
    kept: float,
    full: float,
    driven: IntArray,
    motor_from_joint: FloatArray,
    corrected: FloatArray,
    turning: FloatArray,
    speed: FloatArray,
    certainty: FloatArray,
) -> None:
    """Write the expected speed of the joints, and what it means for the motors.

    Args:
        expected, measured: v (nv,).
        trusted, kept: as for `place_corrected`.
        full: [rad/s] from which a direction is certain.
        driven, motor_from_joint: coordinates (m,), and D^-1 (m, m).
        corrected: result (nv,).
        turning, speed, certainty: results (m,), expected and measured dpsi, and sigma.
    """
    place_corrected(expected, measured, trusted, kept, corrected)
    for i in range(len(turning)):
        turns, moves = 0.0, 0.0
        for j in range(len(driven)):
            share = motor_from_joint[i, j]
            if share != 0.0:
                turns += share * corrected[driven[j]]
                moves += share * measured[driven[j]]
        turning[i], speed[i] = turns, moves
    place_certainty(turning, full, certainty)


@compiled(Nothing, Vector, Vector, Number, OutVector)
def place_advanced(
    speed: FloatArray, acceleration: FloatArray, step: float, advanced: FloatArray
) -> None:
    """Write speed + step acceleration (k,) into `advanced`."""
    for i in range(len(speed)):
        advanced[i] = speed[i] + step * acceleration[i]


@compiled(Nothing, *[Vector] * 4, *[OutVector] * 2)
def place_slopes(
    sigma: FloatArray,
    rest: FloatArray,
    forward: FloatArray,
    backward: FloatArray,
    positive: FloatArray,
    negative: FloatArray,
) -> None:
    """Write the slopes (m,) for either sign of T of gears that turn with certainty `sigma` (m,).

    Args:
        sigma: certainty of direction.
        rest, forward, backward: slopes at standstill, where T sigma > 0, and elsewhere.
        positive, negative: results.
    """
    for i in range(len(sigma)):
        ahead = max(sigma[i], 0.0)
        astern = ahead - sigma[i]
        along, against = forward[i] - rest[i], backward[i] - rest[i]
        positive[i] = ahead * along + astern * against + rest[i]
        negative[i] = ahead * against + astern * along + rest[i]


@compiled(Flag, *[Vector] * 5)
def allowed(
    directions: FloatArray,
    output: FloatArray,
    mesh: FloatArray,
    forward: FloatArray,
    backward: FloatArray,
) -> bool:
    """Return whether the mesh law allows t and T in some directions, within 1e-6 of the largest.

    Args:
        directions: (m,) > 0 forward, < 0 backward, 0 stuck.
        output, mesh: T and t (m,) [N m].
        forward, backward: slopes (m,).
    """
    largest, found = 0.0, True
    for i in range(len(output)):
        largest = max(largest, abs(output[i]))
    slack = 1e-6 * (1.0 + largest)
    for i in range(len(output)):
        one, other = forward[i] * output[i], backward[i] * output[i]
        low, high = min(one, other), max(one, other)
        if directions[i] != 0.0:
            low = high = one if directions[i] > 0.0 else other
        found = found and low - slack <= mesh[i] <= high + slack
    return found


@compiled(Flag, *[Vector] * 8, *[OutVector] * 3)
def place_torques(
    output: FloatArray,
    share: FloatArray,
    sigma: FloatArray,
    rest: FloatArray,
    forward: FloatArray,
    backward: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    mesh: FloatArray,
    torque: FloatArray,
    clipped: FloatArray,
) -> bool:
    """Write t = ((1 - |sigma|) rest + |sigma| (forward or backward)) T and what follows, (m,).

    Args:
        output, share: T and what the rotors take themselves.
        sigma: certainty of direction.
        rest, forward, backward: slopes at standstill, where T sigma > 0, and elsewhere.
        lower, upper: least and greatest N tau_phi.
        mesh: result t.
        torque: result t + share, N tau_phi.
        clipped: result, what the limits leave of it.

    Returns:
        whether the limits leave all of it.
    """
    whole = True
    for i in range(len(output)):
        moving = forward[i] if output[i] * sigma[i] > 0.0 else backward[i]
        mesh[i] = (rest[i] + abs(sigma[i]) * (moving - rest[i])) * output[i]
        torque[i] = mesh[i] + share[i]
        clipped[i] = min(max(torque[i], lower[i]), upper[i])
        whole = whole and clipped[i] == torque[i]
    return whole


@compiled(
    Flag,
    *(Dense, Row, Matrix, Number, Row, Places, Dense, Dense, Row),
    *(OutRow, *[Vector] * 6, OutDense),
)
def place_realised(
    mass: FloatArray,
    bias: FloatArray,
    jacobian: FloatArray,
    scale: float,
    x: FloatArray,
    driven: IntArray,
    topology: FloatArray,
    rotor: FloatArray,
    rotor_bias: FloatArray,
    joint: FloatArray,
    sigma: FloatArray,
    rest: FloatArray,
    forward: FloatArray,
    backward: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    torques: FloatArray,
) -> bool:
    """Write T, the rotors' share, t, N tau_phi and what the limits leave of it, (5, m).

    `place_output` and `place_torques` in one call: handing arrays over takes longer than the work.

    Returns:
        whether the limits leave all of it.
    """
    place_output(
        mass,
        bias,
        jacobian,
        scale,
        x,
        driven,
        topology,
        rotor,
        rotor_bias,
        joint,
        torques[0],
        torques[1],
    )
    return place_torques(
        torques[0],
        torques[1],
        sigma,
        rest,
        forward,
        backward,
        lower,
        upper,
        torques[2],
        torques[3],
        torques[4],
    )


@compiled(Nothing, *[Vector] * 3, Number, Places, Places, OutVector, OutVector)
def place_targets(
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    step: float,
    positions: IntArray,
    velocities: IntArray,
    places: FloatArray,
    rates: FloatArray,
) -> None:
    """Write q + step v + step^2/2 qdd and v + step qdd of some joints (m,).

    Args:
        position, velocity, acceleration: q (nq,), v and qdd (nv,).
        step: [s].
        positions, velocities: where the joints stand in q and v (m,).
        places, rates: results.
    """
    for i in range(len(positions)):
        rate, gain = velocity[velocities[i]], acceleration[velocities[i]]
        places[i] = position[positions[i]] + step * (rate + 0.5 * step * gain)
        rates[i] = rate + step * gain
