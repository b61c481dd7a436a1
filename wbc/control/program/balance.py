"""The equation of motion, row by row, compiled."""

from __future__ import annotations

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Dense,
    Matrix,
    Nothing,
    Number,
    OutMatrix,
    OutRow,
    OutVector,
    Places,
    Row,
    compiled,
)


@compiled(Nothing, Dense, Row, Matrix, Number, Places, OutMatrix, OutVector)
def place_balance(
    mass: FloatArray,
    bias: FloatArray,
    jacobian: FloatArray,
    scale: float,
    undriven: IntArray,
    rows: FloatArray,
    right: FloatArray,
) -> None:
    """Write (M qdd - scale J' f)_undriven = -bias_undriven as rows (u, n) on [qdd, f] = right (u,).

    Args:
        mass, bias: M (nv, nv) and bias (nv,).
        jacobian: J (k, nv) of the contacts.
        scale: [N] per unit of force variable.
        undriven: coordinates (u,).
        rows, right: results.
    """
    nv = len(bias)
    for i in range(len(undriven)):
        row = undriven[i]
        right[i] = -bias[row]
        for j in range(nv):
            rows[i, j] = mass[row, j]
        for k in range(len(jacobian)):
            rows[i, nv + k] = -scale * jacobian[k, row]


@compiled(Nothing, Dense, Row, Row, OutRow)
def place_share(
    rotor: FloatArray, rotor_bias: FloatArray, acceleration: FloatArray, share: FloatArray
) -> None:
    """Write what the rotors take themselves, rotor qdd + rotor_bias (m,) [N m], into `share`."""
    for i in range(len(rotor_bias)):
        torque = rotor_bias[i]
        for j in range(rotor.shape[1]):
            torque += rotor[i, j] * acceleration[j]
        share[i] = torque


@compiled(
    Nothing,
    *(Dense, Row, Matrix, Number, Row, Places, Dense, Dense, Row),
    *[OutRow] * 3,
)
def place_output(
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
    output: FloatArray,
    share: FloatArray,
) -> None:
    """Write T = D' (M qdd + bias - scale J' f)_driven (m,) at x = [qdd, f].

    Args:
        mass, bias, jacobian, scale: as for `place_balance`.
        x: (n,).
        driven: coordinates (m,) in the order of the gears.
        topology: D (m, m).
        rotor, rotor_bias: as for `place_share`.
        joint: memory (m,).
        output: result.
        share: result of `place_share`.
    """
    nv, m = len(bias), len(driven)
    for i in range(m):
        row = driven[i]
        torque = bias[row]
        for j in range(nv):
            torque += mass[row, j] * x[j]
        for k in range(len(jacobian)):
            torque -= scale * jacobian[k, row] * x[nv + k]
        joint[i] = torque
    for i in range(m):
        output[i] = 0.0
    for j in range(m):
        for i in range(m):
            output[i] += topology[j, i] * joint[j]
    place_share(rotor, rotor_bias, x, share)
