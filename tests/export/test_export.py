"""What was found, in the formats of other simulators: read back there, it moves as it does here."""

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from tests.conftest import Told
from tests.effects.test_effect_catalogue import away_from_null
from tests.reference.test_mujoco import plant_run, run
from wbc import Robot, effects, load_robot
from wbc.export import export_robot
from wbc.sim import Plane, Plant

_DURATION, _STEP = 0.6, 2e-4  # [s]; no joint reaches its stop


SAID = (  # what MJCF can say
    effects.PayloadMass("shin", 0.7),
    effects.ViscousFriction("knee", 0.4),
    effects.CoulombFriction("hip", 0.8),
    effects.JointSpring("knee", 3.0, 0.5),
    effects.TorqueConstant("hip", 0.9),
    effects.TorqueOffset("knee", 0.25),
)


def motor_torque(time: float, *_: np.ndarray) -> np.ndarray:
    """Return what both motors are asked for, at their outputs [N m]."""
    return np.array([4.0 * np.sin(5.0 * time), 3.0 * np.cos(4.0 * time)])


def ours(robot: Robot, q: np.ndarray) -> np.ndarray:
    return plant_run(Plant(robot, Plane(height=-10.0)), q, motor_torque, _STEP, _DURATION)


def theirs(robot: Robot, q: np.ndarray) -> np.ndarray:
    model = mujoco.MjModel.from_xml_string(export_robot(robot, "mjcf").text)
    model.opt.timestep = _STEP
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.iterations, model.opt.tolerance = 200, 1e-14
    # As stiff a dry friction as the step allows.
    model.dof_solref[:], model.dof_solimp[:] = [2.0 * _STEP, 1.0], [0.999, 0.9999, 1e-3, 0.5, 2.0]
    model.tendon_solref_fri[:] = [2.0 * _STEP, 1.0]
    return run(model, q, motor_torque, _DURATION)


def test_mujoco_moves_the_exported_leg_as_our_plant_does() -> None:
    bare = load_robot("planar_leg_fixed").lossless()
    leg, q = bare.with_effects(*SAID), bare.pose("paper")
    here = ours(leg, q)
    assert np.abs(here - q).max() > 0.3
    np.testing.assert_allclose(theirs(leg, q), here, atol=2e-3)
    # The effects matter: a leg without them ends elsewhere.
    assert np.abs(ours(bare, q) - here).max() > 0.1


KINDS = ["ricmonk", "tiago", "anymal", "solo12", "talos", "staubli_tx40", "differential_biped"]


@pytest.mark.parametrize("name", KINDS)
def test_mujoco_accelerates_a_fitted_robot_as_our_plant_does(name: str) -> None:
    """Passive joints, seven axes, free bases, coupled gears: one short step each."""
    robot, random, step = load_robot(name).lossless(), np.random.default_rng(1), 1e-6
    joint = robot.transmission.joints[0]
    robot = robot.with_effects(
        effects.ViscousFriction(joint, 0.3),
        effects.TorqueConstant(joint, 0.9),
        effects.RotorInertia(joint, 0.05),
        effects.LinkInertia.at(robot.bodies[-1], {"alpha": 0.05, "t1": 0.02}),
    )
    q = robot.pose() if robot.poses else robot.neutral()
    q = pin.integrate(robot.model, q, random.uniform(-0.3, 0.3, robot.model.nv))
    v, torque = random.uniform(-1.0, 1.0, robot.model.nv), random.uniform(-2.0, 2.0, 40)
    torque = torque[: robot.transmission.size]
    plant = Plant(robot, Plane(height=-50.0))
    after = plant.step(plant.state(q, v), torque / robot.transmission.gear_ratio, step).state
    mine = (after.velocity - v) / step
    model = mujoco.MjModel.from_xml_string(export_robot(robot, "mjcf").text)
    model.opt.timestep = step
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, torque
    if robot.has_free_flyer:
        turn = pin.XYZQUATToSE3(q[:7]).rotation
        data.qpos[3:7], data.qvel[:3] = q[[6, 3, 4, 5]], turn @ v[:3]
        mine[:3] = turn @ (mine[:3] + np.cross(v[3:6], v[:3]))
    start = data.qvel.copy()
    mujoco.mj_step(model, data)
    theirs = (data.qvel - start) / step
    np.testing.assert_allclose(mine, theirs, atol=1e-4 * np.abs(theirs).max())


@pytest.mark.parametrize("to", ["mujoco", "mjcf"])
def test_no_effect_is_left_out_in_silence(to: str) -> None:
    """Each changes the file's numbers, or stands in its list; a supply's power did neither."""
    leg, coupled = (load_robot(n).lossless() for n in ("planar_leg_fixed", "parallelogram_leg"))
    for name, kind in effects.EFFECTS.items():
        robot = coupled if name.startswith("rotor_") else leg
        where = kind.places(robot)[-1]
        effect = away_from_null(kind, robot, where)
        if name == "current_limit":  # half of the motor's own
            effect = kind.at(where, {"limit": 10.0})
        exported, plain = (export_robot(r, to) for r in (robot.with_effect(effect), robot))
        assert (exported.text, exported.losses) != (plain.text, plain.losses), name


def test_a_drive_that_depends_on_more_than_its_torque_has_no_gain() -> None:
    """A supply of a random voltage became a torque constant of 0.74.

    A delay alone was listed as a motor that gives 1 times what it is asked for.
    """
    leg = load_robot("planar_leg_fixed").lossless()
    plain = export_robot(leg, "mjcf")
    for effect in (
        effects.VoltageScaling("knee", 1.0, 48.0),
        effects.SupplySag("robot", 0.01),
        effects.ThermalDrift("knee", 0.02, 5.0),
    ):
        exported = export_robot(leg.with_effect(effect), "mjcf")
        assert exported.notes == plain.notes
        assert set(exported.unsaid) - set(plain.unsaid) == {effect.said()}
    late = export_robot(leg.with_effects(effects.ActuationDelay("knee", 0.005)), "mjcf")
    assert late.unsaid == plain.unsaid
    assert "delay of knee: 0.005 s" in late.notes[0]


def test_what_a_format_cannot_say_stands_on_the_terminal_and_in_the_file(
    tmp_path: Path, told: Told
) -> None:
    leg = load_robot("planar_leg_fixed").with_effects(
        effects.TransmissionEfficiency("knee", 0.66, 0.5),
        effects.StribeckFriction("hip", 0.4, 0.2),
        effects.ActuationDelay("knee", 0.006),
    )
    source = effects.save_robot(leg, tmp_path / "fitted.toml")
    shown = told("export", source, "--to", "mjcf", "--file", target := tmp_path / "leg.xml")
    for said in (shown, " ".join(target.read_text().split())):
        for text in ("forward efficiency 0.66", "Stribeck friction at hip", "delay of knee: 0.006"):
            assert text in said
    assert "delay" not in " ".join(export_robot(leg, "mjcf").unsaid)
