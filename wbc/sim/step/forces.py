"""What those effects of a robot exert in the plant that no table holds: hooks, once per kind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.tables import add_torques, effect_table, left_for_hooks
from wbc.errors import SimulationError
from wbc.robot import Memory, Motion, Robot
from wbc.sim.state import EffectMemory


class EffectForces(NamedTuple):
    """What effects that act by their hooks do over one step.

    Attributes:
        joint: smooth torque on the coordinates (nv,).
        friction: level of dry friction on the coordinates (nv,).
        command: torque (m,) that reaches the drives of the table.
        added: torque on the rotors (m,).
        memory: of the effects, at the end of the step.
        seen: the motion as each of them saw it.
    """

    joint: FloatArray
    friction: FloatArray
    command: FloatArray
    added: FloatArray
    memory: EffectMemory
    seen: tuple[Motion, ...]


class PlantEffects:
    """The effects of a robot, prepared for stepping.

    Attributes:
        robot: whose they are.
        table: those that compiled loops evaluate.
        hooks: the others, one per kind; `SimState.memory` has one entry for each of them.
        first: what these start with; empty where none has a state of its own.
    """

    def __init__(self, robot: Robot) -> None:
        """Prepare the effects of `robot`."""
        self.robot, self.table, self.hooks = robot, effect_table(robot), left_for_hooks(robot)
        held: EffectMemory = tuple(effect.first_memory(robot) for effect in self.hooks)
        self.first = held if any(memory is not None for memory in held) else ()

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
        joint, dry = np.zeros((2, len(motion.velocity)))
        rotor, added, seen = command, np.zeros(len(command)), [motion] * len(self.hooks)
        following: list[FloatArray | None] = []
        for i, effect in enumerate(self.hooks):
            own = memory[i] if memory else None
            if own is not None:
                seen[i] = motion.replace(memory=Memory(own, step))
                own = effect.next_memory(self.robot, seen[i], rotor)
            if memory:
                following.append(own)
            rotor = effect.drive(self.robot, seen[i], rotor)
            add_torques(self.robot, effect, seen[i], (joint, dry, added))
        return EffectForces(joint, dry, rotor, added, tuple(following), tuple(seen))
