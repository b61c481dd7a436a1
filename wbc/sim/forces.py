"""What the effects of a robot exert in the plant, through their generic hooks alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import SimulationError
from wbc.robot import Effect, Memory, Motion, Robot
from wbc.sim.state import EffectMemory


class EffectForces(NamedTuple):
    """Forces of all effects over one step.

    Attributes:
        joint: smooth torque on the coordinates (nv,).
        friction: level of dry friction on the coordinates (nv,), None where no effect has any.
        rotor: torque delivered on the rotors (m,), the drive's and what effects add to it.
        memory: of the effects, at the end of the step.
        kept_joint: part of `joint` (nv,) that effects exert which store energy of their own;
            None where none does.
        kept_rotor: the same part of `rotor` (m,).
        stores: these effects and the motions that they saw.
    """

    joint: FloatArray
    friction: FloatArray | None
    rotor: FloatArray
    memory: EffectMemory
    kept_joint: FloatArray | None = None
    kept_rotor: FloatArray | None = None
    stores: tuple[tuple[Effect, Motion], ...] = ()


def first_memory(robot: Robot) -> EffectMemory:
    """Return the states of their own that the effects of `robot` start with."""
    held = tuple(effect.first_memory(robot) for effect in robot.effects)
    return held if any(memory is not None for memory in held) else ()


def checked_memory(robot: Robot, first: EffectMemory, given: EffectMemory) -> EffectMemory:
    """Return `given`, or `first` where it is empty.

    Raises:
        SimulationError: `given` belongs to other effects than those of `robot`.
    """
    if not given:
        return first
    if [memory is None for memory in given] != [memory is None for memory in first]:
        own = [e.name for e in robot.effects if e.first_memory(robot) is not None]
        raise SimulationError(
            f"the memory of the state does not fit '{robot.name}' (effects with a memory: "
            f"{', '.join(own) or 'none'}); it comes from a plant with other effects. Leave it "
            "empty to start anew."
        )
    return given


def effect_forces(
    robot: Robot,
    at: tuple[FloatArray, FloatArray, float],
    command: FloatArray,
    memory: EffectMemory = (),
    step: float = 0.0,
    temperature: FloatArray | None = None,
    mesh: FloatArray | None = None,
) -> EffectForces:
    """Return what the effects do with a commanded rotor torque (m,) over a step.

    Args:
        robot: whose effects.
        at: q (nq,), v (nv,) and time [s] in the middle of the step.
        command: rotor torque (m,) [N m].
        memory: of the effects at the start of the step; empty where none has any.
        step: h [s].
        temperature: (m,) of the motors [deg C], None where it is not known.
        mesh: T (m,) [N m] that the gears give, None for what effects remember of it.
    """
    joint = np.zeros(robot.model.nv)
    if not robot.effects:
        return EffectForces(joint, None, command, ())
    motion = Motion(at[0], at[1], time=np.asarray(at[2]), temperature=temperature)
    motion = motion.replace(mesh_torque=mesh)
    friction: FloatArray | None = None
    kept_joint, kept_rotor = np.zeros(robot.model.nv), np.zeros(len(command))
    rotor, seen = command, [motion] * len(robot.effects)
    following: list[FloatArray | None] = []
    stores = []
    for i, effect in enumerate(robot.effects):
        own = memory[i] if memory else None
        if own is not None:
            seen[i] = motion.replace(memory=Memory(own, step))
            own = effect.next_memory(robot, seen[i], rotor)
            if type(effect).memory_energy is not Effect.memory_energy:
                stores.append((effect, seen[i]))
        if memory:
            following.append(own)
        rotor = effect.drive(robot, seen[i], rotor)
        smooth = effect.joint_torque(robot, seen[i])
        if smooth is not None:
            joint += smooth
            if stores and stores[-1][0] is effect:
                kept_joint += smooth
        level = effect.joint_friction(robot, seen[i])
        if level is not None:
            friction = level if friction is None else friction + level
    for effect, view in zip(robot.effects, seen, strict=True):
        added = effect.rotor_torque(robot, view)
        if added is not None:
            rotor = rotor + added
            if any(effect is own for own, _ in stores):
                kept_rotor = kept_rotor + added
    return EffectForces(
        joint, friction, rotor, tuple(following), kept_joint, kept_rotor, tuple(stores)
    )
