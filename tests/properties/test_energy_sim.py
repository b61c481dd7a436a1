"""Energy books of simulated runs: losses are never negative and what does not close is O(h)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wbc import load_robot
from wbc.effects import CoulombFriction, StribeckFriction, ViscousFriction
from wbc.sim import EnergyAudit, EnergyFlow, Plant

LEG = load_robot("planar_leg")


def _audit(plant: Plant, state, torque, dt: float, duration: float):
    flow, least = EnergyFlow(), 0.0
    start = plant.mechanical_energy(state)
    for i in range(round(duration / dt)):
        result = plant.step(state, torque((i + 0.5) * dt), dt)
        state, flow = result.state, flow + result.energy
        least = min(least, *result.energy.losses.values())
    return EnergyAudit(flow, plant.mechanical_energy(state) - start), least


VARIANTS = {
    "gears": lambda robot: robot,
    "coupled rotors": lambda robot: replace(robot, rotors_turn_with_links=True),
    "compliant": lambda robot: robot.with_transmission(
        robot.transmission.replace(stiffness=np.full(2, 150.0), damping=np.full(2, 0.3))
    ),
    "play": lambda robot: robot.with_transmission(
        robot.transmission.replace(
            stiffness=np.full(2, 2000.0), damping=np.full(2, 0.5), backlash=np.full(2, 0.02)
        )
    ),
    "friction": lambda robot: robot.with_effects(
        CoulombFriction("hip", 0.5),
        ViscousFriction("knee", 0.2),
        StribeckFriction("knee", 0.3, 0.1),
    ),
}


@pytest.mark.parametrize("name", VARIANTS)
@pytest.mark.parametrize("height", [1.0, 0.02])
def test_the_residual_shrinks_with_the_step(name: str, height: float) -> None:
    robot = VARIANTS[name](LEG)
    plant = Plant(robot)
    q = robot.configuration(hip=0.5, knee=-1.0)
    q[1] += height - plant.gaps(plant.state(q))[0]

    def torque(time: float) -> np.ndarray:
        return np.array([0.3 * np.sin(20.0 * time), -0.3 * np.cos(13.0 * time)])

    coarse, _ = _audit(plant, plant.state(q), torque, 2e-3, 0.24)
    fine, _ = _audit(plant, plant.state(q), torque, 5e-4, 0.24)
    assert fine.flow.lost > 0.1
    assert abs(fine.residual) < 0.35 * abs(coarse.residual) + 1e-5
    assert abs(fine.residual) < 0.02 * fine.flow.lost


def test_a_pinned_foot_does_no_work() -> None:
    """A lossless push-off gained 0.24 % at 1 ms, a hop 3.8 %: the foot worked as its row turned."""
    leg = LEG.lossless().with_transmission(
        LEG.lossless().transmission.replace(torque_limit=np.full(2, 5.0))
    )
    plant, residuals = Plant(leg), []
    q = leg.configuration(hip=-0.6, knee=1.2)
    q[1] -= plant.gaps(plant.state(q))[0]
    for dt in (1e-3, 5e-4):
        audit, _ = _audit(plant, plant.state(q), lambda t: np.array([0.5, -5.0]), dt, 0.1)
        residuals.append(abs(audit.residual) / abs(audit.flow.motor))
    assert residuals[0] < 1e-3
    assert residuals[1] < 0.6 * residuals[0]
