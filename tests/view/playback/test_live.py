"""The live view sends what a browser needs; a window that only listens stands in for one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from meshcat import Visualizer

from wbc.robot import Robot
from wbc.view import LiveView


class Listener:
    def __init__(self) -> None:
        self.transforms: dict[str, np.ndarray] = {}
        self.properties: dict[tuple[str, str], Any] = {}

    def send(self, command: Any) -> None:
        message = command.lower()
        path = message["path"].removeprefix("/meshcat/wbc").removeprefix("/wbc")
        if message["type"] == "set_transform":
            self.transforms[path] = np.reshape(message["matrix"], (4, 4)).T
        if message["type"] == "set_property":
            self.properties[path, message["property"]] = message["value"]


def test_links_force_and_power_follow_the_caller(leg: Robot) -> None:
    window = Listener()
    view = LiveView(leg, viewer=Visualizer(window=window))
    q = leg.configuration(base_z=0.6, hip=0.4, knee=-0.8)
    force = np.array([0.0, 0.0, 186.39])
    view.show(q, {"foot": force}, np.array([1.0, -1.0]))
    data = leg.model.createData()
    pin.framesForwardKinematics(leg.model, data, q)
    shin = window.transforms[f"/robot/j{leg.model.getJointId('knee')}"]
    np.testing.assert_allclose(shin, data.oMi[leg.model.getJointId("knee")].homogeneous)
    foot = data.oMf[leg.model.getFrameId("foot")].translation
    shaft = window.transforms["/contacts/foot/shaft"]
    np.testing.assert_allclose(shaft[:3, 3], foot)
    head = window.transforms["/contacts/foot/head"]
    np.testing.assert_allclose(head[:3, 3] - foot, [0.0, 0.0, shaft[2, 2]], atol=1e-12)
    hubs = {key: value for key, value in window.properties.items() if key[1] == "color"}
    assert len({tuple(colour) for colour in hubs.values()}) == 2
    view.show(q)
    assert window.properties["/contacts/foot/shaft", "visible"] is False
