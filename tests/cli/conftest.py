"""Logs of the fixed leg as files, made once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from wbc import load_robot
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import CoulombFriction
from wbc.measurement import Log, save_log
from wbc.robot import Effect, Motion


@pytest.fixture(scope="session")
def excited_log() -> Callable[..., Log]:
    """Return what noisy sensors report while a multi-sine moves the fixed leg."""

    def make(effects: tuple[Effect, ...] = (), seed: int = 0, duration: float = 4.0) -> Log:
        robot = load_robot("planar_leg_fixed").lossless().with_effects(*effects)
        rng = np.random.default_rng(seed)
        time = np.arange(0.0, duration, 0.002)
        omega = 2.0 * np.pi * np.array([[0.37, 0.83, 1.31], [0.29, 0.71, 1.57]])
        size = np.array([[0.4, 0.25, 0.1], [0.4, 0.3, 0.1]])
        angle = omega[:, :, None] * time + np.array([[0.1, 1.0, 2.0], [0.5, 1.9, 0.3]])[:, :, None]
        q = (size[:, :, None] * np.sin(angle)).sum(1).T + np.array([0.4, -0.7])
        v = ((size * omega)[:, :, None] * np.cos(angle)).sum(1).T
        a = -((size * omega**2)[:, :, None] * np.sin(angle)).sum(1).T
        motion = Motion(q, v, a, time)
        torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
        columns = {}
        for i, joint in enumerate(("hip", "knee")):
            columns[f"{joint}.position"] = q[:, i] + 2e-5 * rng.standard_normal(time.size)
            columns[f"{joint}.velocity"] = v[:, i] + 3e-3 * rng.standard_normal(time.size)
            columns[f"{joint}.rotor_torque"] = torque[:, i] + 2e-3 * rng.standard_normal(time.size)
        return Log(time, columns)

    return make


@pytest.fixture(scope="session")
def rubbing(excited_log: Callable[..., Log], tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Two repeated runs of a leg whose hip rubs, as files."""
    folder = tmp_path_factory.mktemp("logs")
    paths = []
    for seed in (1, 2):
        path = folder / f"run{seed}.csv"
        save_log(excited_log((CoulombFriction("hip", 0.7),), seed), path)
        paths.append(str(path))
    return paths
