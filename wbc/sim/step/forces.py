"""What the effects of a robot exert in the plant: laws of tables, and hooks, once per kind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.tables import (
    EffectTable,
    effect_table,
    fill_delivered,
    fill_joint_torques,
    left_for_hooks,
)
from wbc.errors import SimulationError
from wbc.robot import Effect, Memory, Motion, Robot
from wbc.sim.state import EffectMemory


class EffectForces(NamedTuple):
    """Forces of all effects over one step.

    Attributes:
        joint: smooth torque on the coordinates (nv,).
        friction: level of dry friction on the coordinates (nv,).
        rotor: torque delivered on the rotors (m,), the drive's and what effects add to it.
        memory: of the effects, at the end of the step.
        seen: the motion as each effect that acts by its hooks saw it.
    """

    joint: FloatArray
    friction: FloatArray
    rotor: FloatArray
    memory: EffectMemory = ()
    seen: tuple[Motion, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class PlantEffects:
    """The effects of a robot, prepared for stepping.

    Attributes:
        robot: whose they are.
        table: those that compiled loops evaluate.
        hooks: the others, one per kind; `SimState.memory` has one entry for each of them.
        first: what these start with; empty where none has a state of its own.
        on_drives: whether the table changes what drives give.
    """

    robot: Robot
    table: EffectTable
    hooks: tuple[Effect, ...]
    first: EffectMemory
    on_drives: bool

    @classmethod
    def of(cls, robot: Robot) -> PlantEffects:
        """Return the effects of `robot`."""
        table, hooks = effect_table(robot), left_for_hooks(robot)
        held = tuple(effect.first_memory(robot) for effect in hooks)
        first = held if any(memory is not None for memory in held) else ()
        return cls(robot, table, hooks, first, table.act_on_drives)

    def checked(self, given: EffectMemory) -> EffectMemory:
        """Return a memory `given`, or the first one where it is empty.

        Raises:
            SimulationError: `given` belongs to other effects than these.
        """
        if not given:
            return self.first
        if [memory is None for memory in given] != [memory is None for memory in self.first]:
            own = [e.name for e in self.hooks if e.first_memory(self.robot) is not None]
            raise SimulationError(
                f"the memory of the state does not fit '{self.robot.name}' (effects with a memory: "
                f"{', '.join(own) or 'none'}); it comes from a plant with other effects. Leave it "
                "empty to start anew."
            )
        return given

    def forces(
        self, motion: Motion, command: FloatArray, memory: EffectMemory, step: float
    ) -> EffectForces:
        """Return what the effects do with a commanded rotor torque (m,) over a step.

        Args:
            motion: in the middle of the step; without T of the gears, effects take what they
                remember of it.
            command: rotor torque (m,) [N m].
            memory: of the effects at the start of the step; empty where none has any.
            step: h [s].
        """
        (q, v), table = (motion.position, motion.velocity), self.table
        joint, dry = np.empty(len(v)), np.empty(len(v))
        fill_joint_torques(table.joints, table.numbers, q, v, joint, dry)
        if not self.hooks:
            return EffectForces(joint, dry, self.delivered(command))
        rotor, seen = command, [motion] * len(self.hooks)
        following: list[FloatArray | None] = []
        for i, effect in enumerate(self.hooks):
            own = memory[i] if memory else None
            if own is not None:
                seen[i] = motion.replace(memory=Memory(own, step))
                own = effect.next_memory(self.robot, seen[i], rotor)
            if memory:
                following.append(own)
            rotor = effect.drive(self.robot, seen[i], rotor)
            smooth = effect.joint_torque(self.robot, seen[i])
            if smooth is not None:
                joint += smooth
            level = effect.joint_friction(self.robot, seen[i])
            if level is not None:
                dry += level
        rotor = self.delivered(np.ascontiguousarray(rotor))
        for effect, view in zip(self.hooks, seen, strict=True):
            added = effect.rotor_torque(self.robot, view)
            if added is not None:
                rotor = rotor + added
        return EffectForces(joint, dry, rotor, tuple(following), tuple(seen))

    def delivered(self, command: FloatArray) -> FloatArray:
        """Return what the drives of the table give for a command (m,)."""
        if not self.on_drives:
            return command
        rotor = np.empty(len(command))
        fill_delivered(self.table.drives, command, rotor)
        return rotor
