"""Gears in a tick, compiled: which way they turn, what they give, and the rows that limit it.

Everything stands at the motor outputs, N times the rotors' torque. With sigma the certainty of a
gear's direction, T its output torque and e the slope of the mesh law blended by sigma, t = e T, and
N tau_phi = t + rotor qdd + rotor_bias.
"""

from __future__ import annotations

from typing import Annotated, Any

from wbc.compiled import Dense, OutDense, OutRow, Places, Row, Table, compiled, inner
from wbc.control.tree import TreeMemory
from wbc.effects.tables import fill_joint_torques
from wbc.mechanics.linear import add_times, dot
from wbc.structures import Structure

GEARS = Structure(
    "Gears",
    driven=Places,
    from_joints=Dense,
    topology=Dense,
    inverse_ratio=Row,
    mass=Dense,
    rotor=Dense,
    dry=Row,
    viscous=Row,
    rotor_added=(Row, "m"),
    rest=(Row, "m"),
    forward=(Row, "m"),
    backward=(Row, "m"),
    lower=Row,
    upper=Row,
    laws=Table,
    numbers=Dense,
    drives=Dense,
    effects=(Row, "v"),
    rubbing=(Row, "v"),
    learned=(Row, "v"),
    predicted=Row,
    bound=Row,
    inertia=Dense,
    blend=Row,
    bias=(OutRow, "v"),
    rotor_bias=(OutRow, "m"),
    disturbance=(OutRow, "v"),
    smooth=(OutRow, "v"),
    rubs=(OutRow, "v"),
    turning=(OutRow, "m"),
    sigma=(OutRow, "m"),
    slopes=(OutDense, 2, "m"),
)
"""The gears of a controller, m of them on nv coordinates, and what acts on them in a tick.

driven (m,) coordinates, D^-1 and D (m, m), 1/N (m,); M (nv, nv) with which the rotors' housings
turn; what the rotors take (m, nv) per qdd, their dry and viscous friction and what else is added to
it (m,); slopes of the mesh law at rest, where T sigma > 0, and elsewhere (m,); least and greatest
N tau_phi (m,); effects at joints and drives as `EffectTable` holds them; torque of all other
effects, and level of their dry friction (nv,); of the observer: torque
learned, velocity predicted, bound (nv,), and the rotors' inertia (nv, nv). `blend`: error trusted
and speed of certainty [rad/s], correction [1/s], rate of the observer [1/s], 0 without one.
Results: bias (nv,), rotor_bias (m,), disturbance (nv,), expected dpsi and its certainty (m,), and
slopes (2, m) of the mesh law for T <= 0 and for T > 0; `smooth` and `rubs` (nv,) are memory.
"""
GearsMemory = Annotated[Any, GEARS.kind]

TRUSTED, FULL_SPEED, CORRECTION, OBSERVES = range(4)


@compiled
def place_loads(
    gears: GearsMemory,
    tree: TreeMemory,
    position: Row,
    velocity: Row,
    expected: Row,
    dt: float,
    corrected: OutRow,
) -> None:
    """Write which way joints and motors turn, the mesh law's slopes, and what the bias is.

    Dry friction acts against the direction that the expected speed gives it (`SpeedBlend`). The
    bias holds effects, and what the observer has learned.

    Args:
        gears, tree: GEARS and a TREE.
        position, velocity, expected: q (nq,), measured v and the one expected of it (nv,).
        dt: [s] since the expectation.
        corrected: result (nv,), the expected v drawn towards the measured one.
    """
    blend, driven, bias, nv = gears.blend, gears.driven, gears.bias, len(velocity)
    trusted, full, rate = blend[TRUSTED], blend[FULL_SPEED], blend[OBSERVES]
    kept, smooth, dry = 1.0 - min(blend[CORRECTION] * dt, 1.0), gears.smooth, gears.rubs
    fill_joint_torques(gears.laws, gears.numbers, position, velocity, smooth, dry)
    for i in range(nv):
        corrected[i] = velocity[i]
        corrected[i] -= kept * min(max(velocity[i] - expected[i], -trusted), trusted)
        certain = min(max(corrected[i] / full, -1.0), 1.0)
        bias[i] = tree.bias[i] - smooth[i] - gears.effects[i]
        bias[i] += (dry[i] + gears.rubbing[i]) * certain
    for i in range(len(driven)):
        turns, moves = 0.0, 0.0
        for j in range(len(driven)):
            share = gears.from_joints[i, j]
            if share != 0.0:
                turns += share * corrected[driven[j]]
                moves += share * velocity[driven[j]]
        sigma, at_rest = min(max(turns / full, -1.0), 1.0), gears.rest[i]
        along = at_rest + abs(sigma) * (gears.forward[i] - at_rest)
        against = at_rest + abs(sigma) * (gears.backward[i] - at_rest)
        gears.turning[i], gears.sigma[i] = turns, sigma
        gears.slopes[0, i] = against if sigma > 0.0 else along
        gears.slopes[1, i] = along if sigma > 0.0 else against
        rubs = gears.dry[i] * sigma + gears.viscous[i] * moves
        gears.rotor_bias[i] = rubs + gears.rotor_added[i]
    for i in range(nv if rate > 0.0 else 0):
        surprise, learned, bound = 0.0, gears.learned[i], gears.bound[i]
        for j in range(nv):
            inertia = tree.mass_matrix[i, j] + gears.inertia[i, j]
            surprise += inertia * (velocity[j] - gears.predicted[j])
        # NaN where nothing was predicted
        found = learned + rate * surprise if surprise == surprise else learned
        gears.disturbance[i] = min(max(found, -bound), bound)
        bias[i] -= gears.disturbance[i]


@inner
def place_map(
    gears: GearsMemory, jacobian: Dense, scale: float, torque_map: OutDense, output_bias: OutRow
) -> None:
    """Write T = D' (M qdd + bias - scale J' f)_driven as a map (m, n) and a constant part (m,)."""
    mass, bias, driven, topology = gears.mass, gears.bias, gears.driven, gears.topology
    nv, m = len(bias), len(driven)
    for gear in range(m):
        output_bias[gear] = 0.0
        torque_map[gear, :] = 0.0
        for i in range(m):
            share = topology[i, gear]
            if share == 0.0:
                continue
            row = driven[i]
            output_bias[gear] += share * bias[row]
            add_times(share, mass[row], torque_map[gear])
            for k in range(len(jacobian)):
                torque_map[gear, nv + k] -= scale * share * jacobian[k, row]


@inner
def place_output(
    gears: GearsMemory, torque_map: Dense, output_bias: Row, x: Row, output: OutRow, share: OutRow
) -> None:
    """Write T = map x + output_bias and what the rotors take, rotor qdd + rotor_bias (m,).

    Args:
        gears: GEARS.
        torque_map, output_bias: as `place_map` writes them.
        x: qdd and f (n,).
        output, share: results.
    """
    for i in range(len(output)):
        output[i] = output_bias[i] + dot(torque_map[i], x)
        share[i] = gears.rotor_bias[i] + dot(gears.rotor[i], x)
