"""The shape of a ros2_control controller, without ROS."""

from __future__ import annotations

import numpy as np

from sims import embedding_ros2_control
from sims.embedding_ros2_control import FakeHardware, Return, WholeBodyController
from wbc import load_robot


def test_it_stands_with_the_joints_in_another_order():
    figures = embedding_ros2_control.main(0.2)
    assert figures["errors"] == 0
    assert figures["largest motion of a coordinate"] < 1e-4


def test_calls_out_of_turn_and_broken_states_are_errors():
    loop, commands = WholeBodyController(), {}
    assert loop.activate() is Return.ERROR
    assert loop.update({}, commands, 0.0, 1e-3) is Return.ERROR
    assert loop.configure({"robot": "nobody"}) is Return.ERROR
    assert "nobody" in loop.message
    assert loop.configure({}) is Return.ERROR
    assert loop.configure({"robot": "solo12"}) is Return.OK
    assert loop.activate() is Return.OK
    states = FakeHardware(load_robot("solo12")).read()
    assert set(loop.state_interfaces) == set(states)
    assert loop.update(states, commands, 0.0, 1e-3) is Return.OK
    assert set(commands) == set(loop.command_interfaces)
    assert loop.update(states | {"FL_HAA/velocity": np.nan}, commands, 0.0, 1e-3) is Return.ERROR
    assert np.isfinite(list(commands.values())).all()
    del states["FL_HAA/velocity"]
    assert loop.update(states, commands, 0.0, 1e-3) is Return.ERROR
    assert "FL_HAA" in loop.message
    assert loop.deactivate() is Return.OK
    assert loop.update(states, commands, 0.0, 1e-3) is Return.ERROR
