"""Losses of a robot's gears in MuJoCo, and as functions of arrays for batches of robots.

`wbc export ROBOT --to mujoco` writes this file beside the MJCF, with the robot's numbers at its
end. It needs NumPy only, and MuJoCo where `Losses` is used:

    model = mujoco.MjModel.from_xml_path("robot.xml")
    losses = robot_losses.losses(model)      # once; it changes the model's gears
    data.ctrl[:] = ...                       # torque at the motors' outputs [N m]
    losses.apply(data)                       # before every mj_step, after ctrl is set
    mujoco.mj_step(model, data)

The mesh of a gear takes t = (torque of the motor) - I a - d w and puts out T, both at the gear's
output (I, d: inertia and damping of the rotor; a, w: acceleration and speed of the output):

    w > 0:  T = min(eta_f t, t / eta_b)      w < 0:  T = max(eta_f t, t / eta_b)

At w = 0, T is anything between the two. So T = g t - r |t| sgn(w) with g = (eta_f + 1/eta_b) / 2
and r = (1/eta_b - eta_f) / 2. The share g is constant: it scales the motor, the inertia and the
damping of the rotor once. The rest is a dry friction of level r |t|. MuJoCo solves for it together
with the contacts, also at rest. Only |t| in it is taken from the last step: an error there leaves
at most r / g < 1 of itself after one step. So this is stable at every step size that MuJoCo
is stable at.

Bristles (presliding) take the place of sgn(w): dz/dt = (w - |w| z) / length, solved exactly over a
step. They are springs. A spring that is too stiff for the step becomes as stiff as the step can
carry.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

Array = Any
"""Of NumPy, or of another library with its functions, such as JAX."""
Numbers = Mapping[str, Any]

_STIFF = np.array([0.999, 0.9999, 1e-3, 0.5, 2.0])  # MuJoCo's largest impedance: least creep


def bent_after(bent: Array, way: Array, length: Array) -> Array:
    """Return z of bristles after a way [rad] in one direction from z = `bent`: exact."""
    xp = way.__array_namespace__()
    end = xp.sign(way)
    return end + (bent - end) * xp.exp(-xp.abs(way) / length)


def rigid_mesh(t: Array, coulomb: Array, forward: Array, backward: Array) -> tuple[Array, Array]:
    """Return T = middle - level sgn(w) of gears: the middle and the level [N m].

    Args:
        t: torque into the mesh, the rotor's dry friction not yet paid [N m].
        coulomb: the rotor's dry friction at the output [N m].
        forward, backward: eta_f, eta_b > 0.
    """
    xp = t.__array_namespace__()
    more, less = t + coulomb, t - coulomb
    top = xp.maximum(forward * more, more / backward)
    bottom = xp.minimum(forward * less, less / backward)
    return 0.5 * (top + bottom), 0.5 * (top - bottom)


def next_losses(
    numbers: Numbers, bent: Array, torque: Array, velocity: Array, acceleration: Array, step: float
) -> tuple[Array, Array, Array, Array]:
    """Return what the losses do in the next step, for any number of robots at once.

    With m gears at m driven joints, b bristles at joints, and leading axes (...) of robots.

    Args:
        numbers: of the robot.
        bent: z of the gears' and then of the joints' bristles (..., m + b), zeros at the start.
        torque: of the motors at their outputs (..., m) [N m].
        velocity, acceleration: of the driven joints (..., m), the acceleration of the last step.
        step: [s].

    Returns:
        torque (..., m) [N m] to add to g times the motors' own, at their outputs;
        dry friction of the gears at their outputs (..., m) [N m]; dry friction of the joints
        (..., m) [N m]; `bent` for the next call.
    """
    xp = torque.__array_namespace__()
    n = {name: xp.asarray(value) for name, value in numbers.items() if name != "joints"}
    turned = n["motor_from_joint"]
    speed = velocity @ turned.T
    t = torque - n["rotor_inertia"] * (acceleration @ turned.T) - n["rotor_damping"] * speed
    share = n["slow_coefficient"] * xp.exp(-((speed / n["slow_speed"]) ** 2))
    forward = n["forward_efficiency"] * (1.0 - share)
    backward = n["backward_efficiency"] / (1.0 + share)
    middle, level = rigid_mesh(t, n["rotor_friction"], forward, backward)

    gears, reach = speed.shape[-1], n["gear_length"]
    mean, difference = 0.5 * (1.0 / forward - backward), 0.5 * (1.0 / forward + backward) - 1.0
    give = (turned**2) @ n["inverse_inertia"]
    length = xp.maximum(reach, step**2 * mean * xp.abs(middle) * give + _TINY)
    z = bent_after(bent[..., :gears], step * speed, length)
    loaded = t / (1.0 + mean * z * xp.sign(t) + difference * z**2)
    middle = xp.where(reach > 0.0, loaded, middle)
    level = xp.where(reach > 0.0, n["rotor_friction"], level)

    # Places are (b, m) with a one per row; a table without rows has no width.
    place, slow = (xp.reshape(n[f"{x}_place"], (-1, gears)) for x in ("bristle", "stribeck"))
    most = n["bristle_level"]
    length = xp.maximum(n["bristle_length"], step**2 * most * (place @ n["inverse_inertia"]))
    zj = bent_after(bent[..., gears:], step * (velocity @ place.T), length + _TINY)
    held = ((most * zj) @ place) @ n["joint_from_motor"]
    ratio = (velocity @ slow.T) / n["stribeck_speed"]
    joints = n["joint_friction"] + (n["stribeck_level"] * xp.exp(-(ratio**2))) @ slow
    return middle - n["share"] * t - held, level, joints, xp.concat([z, zj], axis=-1)


class Losses:
    """A robot's losses in MuJoCo: call `apply` before every `mj_step`, after setting `ctrl`.

    Joints and motors are found by their names. The motors must be plain torques at the gears'
    outputs, as `wbc export` writes them. Rotor inertia, damping and dry friction of the driven
    joints are set, whatever the model held. Use one object per model and data.

    Attributes:
        bent: z of the gears' and then of the joints' bristles (m + b,); set zeros to start anew.
    """

    def __init__(self, model: Any, numbers: Numbers) -> None:
        """Set the gears' constants in the model.

        Raises:
            KeyError: the model has no joint or actuator of a name.
        """
        import mujoco

        self._model, self._numbers = model, dict(numbers)
        n = {name: np.asarray(value) for name, value in numbers.items()}
        self._motors = np.array([model.actuator(str(name)).id for name in n["joints"]])
        self._dofs = np.array([int(model.joint(str(name)).dofadr[0]) for name in n["joints"]])
        alone = model.actuator_trntype[self._motors] == int(mujoco.mjtTrn.mjTRN_JOINT)
        # A motor of one joint has its rotor at the joint, any other at its tendon.
        self._serial, self._coupled = np.flatnonzero(alone), np.flatnonzero(~alone)
        self._tendons = model.actuator_trnid[self._motors[self._coupled], 0]
        self._scale = np.diag(n["motor_from_joint"])[self._serial]
        model.actuator_gainprm[self._motors, 0] = n["share"] * n["gain"]
        inertia, damping = n["share"] * n["rotor_inertia"], n["share"] * n["rotor_damping"]
        own = self._dofs[self._serial]
        model.dof_armature[self._dofs], model.dof_damping[self._dofs] = 0.0, n["joint_damping"]
        model.dof_armature[own] = self._scale**2 * inertia[self._serial]
        model.dof_damping[own] += self._scale**2 * damping[self._serial]
        model.tendon_armature[self._tendons] = inertia[self._coupled]
        model.tendon_damping[self._tendons] = damping[self._coupled]
        stiff = [2.0 * model.opt.timestep, 1.0]  # stops within the step, no more
        model.dof_solref[self._dofs], model.dof_solimp[self._dofs] = stiff, _STIFF
        model.tendon_solref_fri[self._tendons] = stiff
        model.tendon_solimp_fri[self._tendons] = _STIFF
        mujoco.mj_setConst(model, mujoco.MjData(model))
        self._numbers["inverse_inertia"] = model.dof_invweight0[self._dofs]
        self.bent = np.zeros(n["joints"].size + n["bristle_level"].size)

    def apply(self, data: Any) -> None:
        """Set the losses of the next step, from this state and its controls."""
        model, n = self._model, self._numbers
        asked = data.ctrl[self._motors]
        low, high = model.actuator_ctrlrange[self._motors].T
        bound = model.actuator_ctrllimited[self._motors].astype(bool)
        asked = np.where(bound, np.clip(asked, low, high), asked)
        torque = np.asarray(n["gain"]) * asked + np.asarray(n["offset"])
        velocity, acceleration = data.qvel[self._dofs], data.qacc[self._dofs]
        added, level, joints, self.bent = next_losses(
            n, self.bent, torque, velocity, acceleration, model.opt.timestep
        )
        offset = np.asarray(n["share"]) * np.asarray(n["offset"])
        model.actuator_biasprm[self._motors, 0] = offset + added
        joints[self._serial] += np.abs(self._scale) * level[self._serial]
        model.dof_frictionloss[self._dofs] = joints
        model.tendon_frictionloss[self._tendons] = level[self._coupled]


_TINY = 1e-12  # [rad]
