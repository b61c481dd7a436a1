"""The losses of an exported robot in MuJoCo's step, beside our plant's."""

import subprocess
import sys
from collections.abc import Callable
from copy import copy
from pathlib import Path
from runpy import run_path

import mujoco
import numpy as np
import pytest

from tests.sim.random_robots import geared
from wbc import Robot, effects, load_robot
from wbc.cli import main
from wbc.errors import RobotError
from wbc.export import export_robot, loss_numbers
from wbc.export.losses import Losses, next_losses
from wbc.robot import Effect
from wbc.sim import Plane, Plant

_TICK = 1e-3  # [s]


def lossy(robot: Robot, reflected: np.ndarray, *more: Effect) -> Robot:
    """Return the robot on gears that lose power both ways, with rotors and effects."""
    joints = robot.transmission.joints
    gears = [effects.TransmissionEfficiency(joint, 0.85, 0.75) for joint in joints]
    rotors = map(effects.RotorInertia, joints, reflected.tolist())
    return robot.with_effects(*gears, *rotors, *more)


def leg() -> tuple[Robot, np.ndarray, np.ndarray, float]:
    robot = load_robot("planar_leg_fixed").with_effects(
        effects.CoulombFriction("hip", 0.8),
        effects.ViscousFriction("knee", 0.3),
        effects.Presliding("hip", 0.7, 0.02),
        effects.LoadFriction("hip", 0.1),
        effects.StribeckFriction("knee", 0.6, 0.3),
        effects.LoadStribeckFriction("hip", 0.1, 0.3),
    )
    return robot, robot.pose("paper"), np.array([0.5, -0.4]), 60.0


def go2() -> tuple[Robot, np.ndarray, np.ndarray, float]:
    robot = load_robot("go2")
    hips, thighs, calves = (robot.transmission.joints[k::3] for k in range(3))
    robot = lossy(
        robot,
        np.full(12, 0.01),
        *(effects.CoulombFriction(joint, 0.3) for joint in hips),
        *(effects.ViscousFriction(joint, 0.1) for joint in thighs),
        effects.Presliding(thighs[0], 0.4, 0.02),
        effects.LoadPresliding(calves[1], 0.8, 0.7, 0.03),
        effects.LoadFriction(calves[2], 0.15),
    )
    return robot, np.tile([0.0, 0.8, -1.6], 4), np.tile([0.3, -0.3, 0.35], 4), 20.0


def arm() -> tuple[Robot, np.ndarray, np.ndarray, float]:
    robot = load_robot("tiago")
    joints = robot.transmission.joints
    robot = lossy(
        robot,
        np.array([20.0, *7 * [0.05]]),
        effects.Presliding(joints[2], 2.0, 0.01),
        effects.ViscousFriction(joints[2], 2.0),
        effects.LoadFriction(joints[3], 0.1),
        effects.LoadPresliding(joints[4], 0.75, 0.6, 0.02),
        effects.CoulombFriction(joints[5], 0.8),
        effects.CoulombFriction(joints[7], 0.5),
    )
    start = np.array([0.2, 0.5, 0.8, 0.2, 0.6, 0.1, 0.2, 0.1])
    return robot, start, np.array([0.02, 0.4, 0.5, 0.6, 0.5, 0.5, 0.4, 0.4]), 200.0


def servo(robot: Robot, target: np.ndarray, gain: float, motion: tuple) -> np.ndarray:
    """Return what a position controller asks of the motors, at their outputs (m,) [N m]."""
    position, velocity = (x[robot.actuated] for x in motion)
    # A slide carries the arm.
    gains = np.where([j.startswith("torso") for j in robot.transmission.joints], 100.0, 1.0) * gain
    wanted = gains * (target - position) - 0.05 * gains * velocity
    return np.asarray(np.linalg.inv(robot.transmission.motor_from_joint).T @ wanted)


def ours(robot: Robot, q: np.ndarray, ask: Callable, duration: float) -> np.ndarray:
    plant, asked = Plant(robot, terrain=Plane(height=-50.0)), []
    state = plant.state(q)
    for k in range(round(duration / _TICK)):
        asked.append(ask(k * _TICK, (state.position, state.velocity)))
        torque = asked[-1] / robot.transmission.gear_ratio
        state = plant.step(state, torque, _TICK).state
    return np.array(asked)


def written(robot: Robot, folder: Path) -> str:
    """Return the model that the command writes, beside the file of losses."""
    source, target = str(folder / "fitted.toml"), str(folder / "leg.xml")
    effects.save_robot(robot, source)
    assert main(["export", source, "--to", "mujoco", "--file", target]) == 0
    return target


def nothing(*_: object) -> float:
    return 0.0


def theirs(
    model: mujoco.MjModel, losses: Callable, q: np.ndarray, duration: float, ask: Callable = nothing
) -> tuple[np.ndarray, np.ndarray]:
    """Return where MuJoCo ends, and what was asked of the motors on the way."""
    data, asked, step = mujoco.MjData(model), [], model.opt.timestep
    data.qpos[:] = q
    for k in range(round(duration / step)):
        asked.append(ask(k * step, (np.array(data.qpos), np.array(data.qvel))))
        data.ctrl[:] = asked[-1]
        losses(data)
        mujoco.mj_step(model, data)
    return np.array(data.qpos), np.array(asked)


@pytest.mark.parametrize("machine", [leg, go2, arm], ids=lambda machine: machine.__name__)
def test_motors_need_the_torque_that_they_need_in_our_plant(
    machine: Callable, tmp_path: Path
) -> None:
    """Driving and back-driven: the largest joint error is below 1 % of the torque at 1 ms.

    In MuJoCo moves what `wbc export` wrote. `pytest -s` shows both errors.
    """
    robot, start, swing, gain = machine()

    def ask(time: float, motion: tuple[np.ndarray, ...]) -> np.ndarray:
        late = np.arange(len(start))
        turned = np.sin(late + 4.0 * time) - np.sin(late)
        return servo(robot, start + swing * turned, gain, motion)

    here = ours(robot, start, ask, 0.8)
    size = np.sqrt(np.mean(here**2, axis=0))
    model = mujoco.MjModel.from_xml_path(written(robot, tmp_path))
    model.opt.timestep = _TICK
    plain = copy(model)
    losses = run_path(str(tmp_path / "leg_losses.py"))["losses"](model).apply
    sides = (model, losses), (plain, nothing)
    found = (theirs(*side, start, 0.8, ask)[1] for side in sides)
    with_losses, without = (np.sqrt(np.mean((x - here) ** 2, axis=0)) / size for x in found)
    print(f"{robot.name}: {with_losses.max():.2%} with the losses, {without.max():.0%} without")
    assert with_losses.max() < 0.01
    assert without.max() > 0.2


@pytest.mark.parametrize("step", [1e-3, 5e-3])
def test_a_leg_that_is_let_go_holds_or_falls_as_in_our_plant(step: float) -> None:
    """Driven back by its own weight alone, at a fine and at a coarse step."""
    robot, start, _, _ = leg()
    for weight, moves in ((1.0, True), (0.05, False)):
        light = robot.with_gravity([0.0, 0.0, -9.81 * weight])
        plant = Plant(light, terrain=Plane(height=-50.0))
        state = plant.run(plant.state(start), np.zeros(2), 0.4, 400)[-1].state
        model = mujoco.MjModel.from_xml_string(export_robot(light, "mujoco").text)
        model.opt.timestep = step
        end, _ = theirs(model, Losses(model, loss_numbers(light)).apply, start, 0.4)
        moved = np.abs(state.position - start).max()
        assert moved > 0.1 if moves else moved < 0.02  # what bristles bend
        # A coarse step of semi-implicit Euler errs by half its length times the speed.
        atol = (2.0 * step * np.abs(state.velocity).max()) if moves else 1e-4
        np.testing.assert_allclose(end, state.position, atol=atol)


@pytest.mark.parametrize("backward", [0.05, 0.3])
@pytest.mark.parametrize("step", [2e-4, 2e-3, 1e-2])
def test_no_step_is_too_coarse_for_the_losses(backward: float, step: float) -> None:
    """Gears that hardly yield, on heavy rotors: the losses never make energy."""
    robot = load_robot("planar_leg_fixed").with_gravity([0.0, 0.0, 0.0])
    robot = geared(robot, backward_efficiency=backward, rotor_inertia=1e-3)
    plain = mujoco.MjModel.from_xml_string(export_robot(robot, "mujoco").text)
    model = copy(plain)
    model.opt.timestep = step
    losses = Losses(model, loss_numbers(robot))
    data, own = mujoco.MjData(model), mujoco.MjData(plain)
    data.qvel[:] = 3.0, -4.0
    energies, inertia = [], np.zeros((2, 2))
    for _ in range(round(1.0 / step)):
        own.qpos[:], own.qvel[:] = data.qpos, data.qvel
        mujoco.mj_forward(plain, own)  # with the rotors as they are
        mujoco.mj_fullM(plain, own, inertia)
        energies.append(0.5 * float(data.qvel @ inertia @ data.qvel))
        losses.apply(data)
        mujoco.mj_step(model, data)
    assert energies[-1] < 0.7 * energies[0]
    assert max(energies) < 1.005 * energies[0]  # MuJoCo alone: 1.0007 at the coarsest step


def batch() -> tuple[dict, list[np.ndarray]]:
    """Return a robot's numbers, and arguments for twenty robots."""
    robot, *_ = go2()
    numbers, random = loss_numbers(robot), np.random.default_rng(1)
    numbers["inverse_inertia"] = np.full(12, 20.0)
    sizes = 12 + len(np.asarray(numbers["bristle_level"])), 12, 12, 12
    return numbers, [random.uniform(-1.0, 1.0, (4, 5, size)) for size in sizes]


def test_many_robots_at_once_are_each_of_them_alone() -> None:
    numbers, arguments = batch()
    together = next_losses(numbers, *arguments, 1e-3)
    alone = next_losses(numbers, *(x[2, 3] for x in arguments), 1e-3)
    for several, one in zip(together, alone, strict=True):
        np.testing.assert_allclose(np.broadcast_to(several, (4, 5, several.shape[-1]))[2, 3], one)


def test_jax_gives_the_same_as_numpy() -> None:
    jax = pytest.importorskip("jax")
    numbers, arguments = batch()
    arrays = {name: jax.numpy.asarray(x) for name, x in numbers.items() if name != "joints"}
    step = jax.jit(lambda *given: next_losses(arrays, *given, 1e-3))
    known = next_losses(numbers, *arguments, 1e-3)
    for found, expected in zip(step(*arguments), known, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("robot", [leg()[0], load_robot("planar_leg_fixed")], ids=["many", "few"])
def test_the_written_file_needs_numpy_and_mujoco_only(
    robot: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start, target = robot.pose("paper"), written(robot, tmp_path)
    printed = "".join(capsys.readouterr().out.split())  # long paths are wrapped anywhere
    assert "leg_losses.py:thelossesofthegears" in printed
    assert export_robot(robot, "mujoco").unsaid == ()
    user = (
        "import sys, mujoco, leg_losses\n"
        "model = mujoco.MjModel.from_xml_path('leg.xml')\n"
        "losses, data = leg_losses.losses(model), mujoco.MjData(model)\n"
        f"data.qpos[:] = {start.tolist()}\n"
        "for _ in range(100):\n"
        "    losses.apply(data)\n"
        "    mujoco.mj_step(model, data)\n"
        "print(*data.qpos, 'wbc' in sys.modules)\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", user],
        cwd=tmp_path,
        env={"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    model = mujoco.MjModel.from_xml_path(target)
    losses = Losses(model, loss_numbers(robot)).apply
    end, _ = theirs(model, losses, start, 100 * model.opt.timestep)
    assert told[-1] == "False"
    np.testing.assert_allclose([float(x) for x in told[:2]], end, atol=1e-12)


def test_a_self_locking_gear_is_refused() -> None:
    locking = geared(load_robot("planar_leg_fixed"), backward_efficiency=[0.5, -0.2])
    with pytest.raises(RobotError, match="gear of 'knee' is self-locking"):
        export_robot(locking, "mujoco")
    assert "gear at knee" in " ".join(export_robot(locking, "mjcf").unsaid)  # the way out
