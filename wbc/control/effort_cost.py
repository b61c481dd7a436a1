"""The cost of an effort on the variables of the contact-force program."""

from __future__ import annotations

from wbc.arrays import FloatArray
from wbc.control.efforts import GearCost
from wbc.control.plant import Plant


def add_effort(
    cost: GearCost, torque_map: FloatArray, plant: Plant, H: FloatArray, g: FloatArray
) -> None:
    """Add 1/2 sum weight (slope T + rotor share)^2 to a Hessian and a gradient.

    Args:
        cost: of the effort in this tick.
        torque_map: (m, n), T = torque_map @ x + D' bias_m.
        plant: the dynamics.
        H, g: (n, n) and (n,), changed in place.
    """
    nv = plant.rotor.shape[1]
    rows = torque_map * cost.slope[:, None]
    offset = cost.slope * plant.output_bias
    if cost.rotor:
        rows[:, :nv] += cost.rotor * plant.rotor
        offset += cost.rotor * plant.rotor_bias
    weighted = rows.T * cost.weight
    H += weighted @ rows
    g += weighted @ offset
