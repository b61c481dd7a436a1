"""The controller on plants from outside, and in the loops that the documentation shows."""

import numpy as np
import pytest

from sims import embedding_mujoco, embedding_plain, embedding_realtime, embedding_ros2_control
from sims.closed_loop import DEPTH, PUSH, OwnPlant, engine_of, main, run
from sims.embedding_realtime import PATIENCE, PERIOD, DeadlineMonitor
from sims.embedding_ros2_control import FakeHardware, Return, WholeBodyController
from sims.legged import pushed, squat
from sims.mujoco_plant import MujocoPlant
from wbc import load_robot

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
ERROR, TORQUE = "centre of mass, rms error [mm]", "torque, rms [% of limit]"
LARGEST = "centre of mass, largest error [mm]"


@pytest.fixture(scope="module")
def solo():
    return main(0.45, ["solo12"], ["MuJoCo"])


@pytest.mark.parametrize("robot", ["solo12", "talos"])
def test_knowing_the_losses_pays_in_mujoco(robot, solo):
    """MuJoCo's links, contacts and integrator, and losses written anew as an external torque."""
    found = solo if robot == "solo12" else main(0.45, [robot], ["MuJoCo"])
    assert all(figures["refused ticks"] == 0 for figures in found.values())
    for act in ("stand", "squat", "push"):
        knows, not_ = (found[robot, "MuJoCo", act, k] for k in ("dissipative", "conservative"))
        if act == "squat":  # here the other one moves less, and needs less
            assert knows[ERROR] < 1.0
            assert knows[ERROR] < 0.25 * not_[ERROR]
        else:
            assert knows[ERROR] < 1.1 * not_[ERROR] + 0.1
            assert knows[TORQUE] < 1.1 * not_[TORQUE]


def test_mujoco_and_the_plant_agree(solo):
    """Two implementations of links, contacts and gears: the same squat, within a few percent."""
    robot, act = load_robot("solo12"), squat(DEPTH["solo12"], 1.0)
    for kind, model in (("dissipative", robot), ("conservative", robot.lossless())):
        one = solo["solo12", "MuJoCo", "squat", kind]
        other = run(engine_of("wbc.sim", robot, robot.pose()), robot, model, act, 0.45)
        assert one[ERROR] == pytest.approx(other[ERROR], rel=0.1)
        assert one[TORQUE] == pytest.approx(other[TORQUE], rel=0.02)


def test_both_plants_tip_a_pushed_humanoid_onto_the_edges_of_its_soles_and_back():
    """Eight points share the load; soles tip, land flat and rock: rigid here, soft in MuJoCo."""
    talos = load_robot("talos")
    pose, act = np.array(talos.pose("half_sitting")), pushed(PUSH["talos"], 0.05, 0.1)
    plants = OwnPlant(talos, pose), MujocoPlant(talos, pose)
    one, other = (run(plant, talos, talos, act, 0.5) for plant in plants)
    assert one["refused ticks"] == other["refused ticks"] == 0
    for figure in (ERROR, LARGEST, TORQUE):
        assert one[figure] == pytest.approx(other[figure], rel=0.1)
    assert one[LARGEST] > 4.0


@pytest.mark.parametrize("loop", [embedding_plain, embedding_mujoco], ids=["plain", "MuJoCo"])
def test_a_loop_of_the_documentation_stands(loop):
    figures = loop.main(0.2)
    assert figures["refused ticks"] == 0
    assert figures["largest error of the centre of mass [mm]"] < 2.0


class Clock:
    """A clock that advances only when told, or by `cost` at every reading."""

    def __init__(self, cost):
        self.now, self.cost, self.slept = 0.0, cost, []

    def __call__(self):
        self.now += self.cost
        return self.now

    def sleep(self, time):
        self.now += time
        self.slept.append(time)


def test_monitor_keeps_the_period_and_does_not_make_up_for_missed_ones():
    clock = Clock(0.0)
    monitor = DeadlineMonitor(clock, clock.sleep)
    clock.now += 0.4 * PERIOD
    monitor.wait()
    assert clock.slept == [pytest.approx(0.6 * PERIOD)]
    clock.now += 3.5 * PERIOD
    monitor.wait()
    assert (monitor.missed, monitor.in_a_row, len(clock.slept)) == (1, 1, 1)
    monitor.wait()
    assert clock.slept[-1] == pytest.approx(PERIOD)
    assert monitor.in_a_row == 0


def test_realtime_loop_says_late_and_hands_over():
    slow = Clock(2.0 * PERIOD)
    figures = embedding_realtime.main(0.05, budget=1e-9, clock=slow, sleep=slow.sleep)
    assert figures["ticks"] == figures["late by the controller's own clock"] == 50
    assert figures["periods missed"] == 50
    assert figures["ticks left to the drives"] == 50 - PATIENCE
    assert figures["unusable"] == 0
    easy = Clock(0.0)
    figures = embedding_realtime.main(0.05, budget=10.0, clock=easy, sleep=easy.sleep)
    assert figures["late by the controller's own clock"] == figures["periods missed"] == 0
    assert np.isclose(easy.now, 0.05)


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
