"""What a plant prepares once: the parts of the equations that never change, and working memory."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias, cast

import numpy as np
import pinocchio as pin
from scipy.linalg import lapack

from wbc.arrays import FloatArray, IntArray
from wbc.dynamics import Workspace
from wbc.dynamics.equation import RotorCoupling, rotor_coupling
from wbc.effects.tables import add_torques, effect_table, left_for_hooks
from wbc.errors import SimulationError
from wbc.mechanics.kinematics import Tree, tree_of
from wbc.mechanics.memory import Heap
from wbc.robot import Memory, Motion, Robot
from wbc.robot.body_contacts import Hull
from wbc.sim.barriers import Barriers
from wbc.sim.ground import Terrain
from wbc.sim.step import tables
from wbc.sim.step.books import survey
from wbc.sim.step.contacts import gaps_of
from wbc.sim.step.tables import EffectMemory, SimState
from wbc.structures import Structure, stored

_Answer = ctypes.CFUNCTYPE(None)
_STAGES = 4  # most steps have less
_FIRST_WORDS = 1000  # of the heap per coordinate; a step asks for more


_PLANAR_ORDER = ("JointModelPX", "JointModelPZ", "JointModelRY")

EffectActs: TypeAlias = tuple[EffectMemory, tuple[Motion, ...]]
"""Of effects that act by hooks: their memory at the end of a part, and the motion that each saw."""


def free_bases(robot: Robot) -> IntArray:
    """Return the free bases (b, 5) of `robot`: free flyers, and planar ones of PX, PZ, RY joints.

    They are roots that no gear drives and nothing holds; columns JOINT to PLACES. None where rotors
    couple to their housings: part of the momentum is then in their spin, and the velocity terms
    stay explicit.
    """
    found: list[tuple[int, int, int, int, int]] = []
    model, driven = robot.model, set(robot.actuated.tolist())
    for number in range(1, model.njoints):
        joint = model.joints[number]
        if model.parents[number] != 0 or robot.rotors_turn_with_links:
            continue
        if joint.shortname() == "JointModelFreeFlyer":
            found.append((number - 1, number - 1, joint.idx_v, 6, joint.idx_q))
        elif _planar(model, number) and not driven & set(range(joint.idx_v, joint.idx_v + 3)):
            found.append((number - 1, number + 1, joint.idx_v, 3, joint.idx_q))
    return np.array(found, dtype=np.int64).reshape(-1, 5)


def _planar(model: Any, number: int) -> bool:
    """Return whether a PX, PZ and RY joint follow each other from `number`, along world axes."""
    if number + 2 >= model.njoints:
        return False
    chain = range(number, number + 3)
    names = tuple(model.joints[i].shortname() for i in chain)
    inner = [i for i in range(1, model.njoints) if model.parents[i] in (number, number + 1)]
    level = all(np.allclose(model.jointPlacements[i].rotation, np.eye(3)) for i in chain)
    return names == _PLANAR_ORDER and level and inner == [number + 1, number + 2]


class Drivetrain:
    """Gears of a robot as rows; all quantities at the motor outputs psi.

    Attributes:
        robot, gears: whose they are, and their numbers.
        rows: D^-1 on the driven columns (m, nv), psi_dot = rows @ v.
        loose: (m,) whether the motor's output may leave the joint (stiffness or play).
        any_loose: whether any of them may.
    """

    def __init__(self, robot: Robot) -> None:
        """Collect the gears of `robot`."""
        self.robot, self.gears = robot, robot.transmission
        gears = self.gears
        self.rows = robot.motor_rows
        self.loose = np.isfinite(gears.stiffness) | (gears.backlash > 0.0)
        self.any_loose = bool(self.loose.any())

    def tables(self) -> tables.Gears:
        """Return the gears as tables for compiled loops."""
        gears, (m, nv), ratio = self.gears, self.rows.shape, self.gears.gear_ratio
        # What these lose is up to their effects, which carry a state.
        meshed = [gears.index(e.where) for e in self.robot.effects if "meshed" in e.acts_by]
        kept = ~np.isin(np.arange(m), meshed)
        backward = np.where(kept, gears.backward_efficiency, 1.0)
        direct = not self.any_loose and np.array_equal(gears.topology, np.eye(m))
        row = np.where(direct & (backward >= 0.0), self.robot.actuated, -1)
        numbers = {
            **{"ratio": ratio, "inertia": gears.reflected_inertia, "backward": backward},
            "viscous": ratio**2 * gears.rotor_viscous_friction,
            "coulomb": np.abs(ratio) * gears.rotor_coulomb_friction,
            "inverse": np.where(kept, 1.0 / gears.forward_efficiency, 1.0),
            **{"stiffness": gears.stiffness, "damping": gears.damping, "play": gears.backlash},
            **{"rows": self.rows, "row": row, "alone": ~np.isin(np.arange(nv), row)},
            **{"yields": self.loose, "loose": self.any_loose},
        }
        coupled = m if self.robot.rotors_turn_with_links else 0
        return tables.GEARS.of({"coupled": coupled, "v": nv, "both": nv + m}, **numbers)

    def motion(self, state: SimState) -> tuple[FloatArray, FloatArray]:
        """Return deflections (m,) [rad] and speeds (m,) [rad/s] of the motor outputs."""
        joint = self.rows @ state.velocity
        if not self.any_loose:
            return np.zeros(len(joint)), joint
        given = state.motor_velocity if len(state.motor_velocity) else joint
        deflection = state.deflection if len(state.deflection) else np.zeros(len(joint))
        return deflection, np.where(self.loose, given, joint)

    def rotors(self, state: SimState) -> tuple[FloatArray, FloatArray]:
        """Return angles (m,) [rad], speeds (m,) [rad/s] of the rotors, zero where joints are."""
        deflection, speed = self.motion(state)
        joint = self.gears.motor_from_joint @ state.position[self.robot.actuated_position]
        ratio = self.gears.gear_ratio
        return ratio * (joint + deflection), ratio * speed


class Setup:
    """A robot on a terrain, prepared for stepping, with the memory of the compiled loops.

    Attributes:
        robot: what moves.
        terrain: what it stands on.
        temperature: (m,) of the motors [deg C], None where it was not given.
        space: memory for its kinematics.
        drive: its gears.
        barriers: its limits and contacts.
        hooks: effects that no table holds, one per kind; `SimState.memory` has one entry for each.
        first_memory: what these start with; empty where none has a state of its own.
        waits: whether a part needs Python in its middle: for effects that no table holds, or for
            rotor coupling.
        plant: numbers and memory of the loops, which Python reads and writes between them, too.
        acts: what the effects did in each part of the last step, by its stage, where it waits.
    """

    def __init__(
        self,
        robot: Robot,
        terrain: Terrain,
        hulls: tuple[Hull, ...],
        temperature: FloatArray | None,
        bounds: FloatArray,
    ) -> None:
        """Prepare `robot` on `terrain`.

        Args:
            robot, terrain, temperature: see `Plant`.
            hulls: of its links that meet edges, and each other.
            bounds: of `Opened`; SLOW is written here.

        Raises:
            SimulationError: a robot with a body without mass that moves freely, with a joint of a
                kind that the plant does not know, or with rotors that spin too much inertia.
        """
        self.robot, self.terrain, self.temperature = robot, terrain, temperature
        self.space = Workspace(robot)
        inertia = pin.crba(self.space.model, self.space.data, robot.neutral())
        if lapack.dpotrf(inertia)[1] != 0:
            raise SimulationError(
                f"'{robot.name}': the inertia matrix of the links is not positive definite: some "
                "body without mass moves freely. Give every moving body a mass."
            )
        tree, self.drive = tree_of(robot.model), Drivetrain(robot)
        self.barriers = Barriers(robot, terrain, tree, hulls)
        self.hooks = left_for_hooks(robot)
        held: EffectMemory = tuple(effect.first_memory(robot) for effect in self.hooks)
        self.first_memory = held if any(memory is not None for memory in held) else ()
        self.waits = bool(self.hooks) or robot.rotors_turn_with_links
        self._error: BaseException | None = None
        self._answers: list[Any] = []
        self.acts: dict[int, EffectActs] = {}
        words = np.empty(_FIRST_WORDS * robot.model.nv)
        room = words, words.view(np.int64), np.zeros(2, np.int64), self._address(self._take_more)
        self._heap = stored(Heap(*room))
        self.plant = self._opened(tree, bounds)
        self._check_rotors(inertia)

    def _opened(self, tree: Tree, bounds: FloatArray) -> tables.Opened:
        """Return numbers and memory as the structure that compiled loops read and write."""
        robot, barriers, bases = self.robot, self.barriers, free_bases(self.robot)
        model, m, size = robot.model, len(self.drive.rows), barriers.size
        nv, limits, contacts = model.nv, barriers.limits, size - barriers.limits
        back, gravity = bounds[tables.RESTITUTION], np.linalg.norm(model.gravity.linear)
        bounds[tables.SLOW] = gravity * min(1.0, (1.0 - back) / (2.0 * back) if back > 0.0 else 1.0)
        meshed = any("meshed" in effect.acts_by for effect in robot.effects)
        sizes = {"q": model.nq, "v": nv, "m": m, "meshed": m if meshed else 0}
        sizes |= {"joints": model.njoints - 1, "poses": model.njoints, "bases": len(bases)}
        sizes |= {"k": barriers.points, "c": contacts, "barriers": size}
        sizes["rows"] = m + nv + size + 2 * contacts
        sizes["pushes"] = 3 * (barriers.points + len(barriers.pairs))
        now, self._now_kind = _memory(tables.NOW, sizes)
        end, self._end_kind = _memory(tables.ENDING, sizes)
        placed = tables.PLACED_TREE.of(sizes, bases=bases)
        placed.poses[-1, [0, 4, 8]] = 1.0
        rigid = limits if bounds[tables.HERTZ] > 0.0 else size
        asked = self._address(self._ask_ground) if barriers.asks else 0
        counts = {"limits": limits, "rigid": rigid, "asked": asked}
        obstacles = tables.OBSTACLES.of(sizes, **barriers.obstacles, **counts)
        asked = self._address(self._ask_forces) if self.waits else 0
        full = self._address(self._take_more_stages)
        known = effect_table(robot)._asdict()
        forces = tables.FORCES.of(sizes, **known, asked=asked, full=full)
        forces.high[:] = robot.transmission.torque_limit
        forces.low[:] = -forces.high
        stages = np.zeros((_STAGES, len(now.words) + len(end.words)))
        parts = stored(tree), obstacles, self.drive.tables(), placed, barriers.bodies, forces
        return stored(tables.Opened(*parts, now, end, stages, bounds, self._heap))

    def _ask_ground(self) -> None:
        """Fill gaps and normals of ground that only Python knows."""
        told = self.plant.obstacles
        count = len(told.points)
        try:
            for number, solid in enumerate(self.terrain.solids):
                own = slice(number * count, (number + 1) * count)
                told.touch[own, 0], told.touch[own, 1:4] = solid.gap(told.points)
        except BaseException as error:
            self._error, told.touch[:] = error, np.nan

    def _ask_forces(self) -> None:
        """Tell what acts in the middle of a part, or on an impact, where only Python knows it."""
        now, told = self.plant.now, self.plant.forces
        step = now.numbers.item(tables.LENGTH)
        try:
            if step == 0.0:
                self.tell_coupling(now.position, now.velocity)
                return
            q, v = self.plant.end.before.copy(), self.plant.end.speed.copy()
            self._act(q, v, step)
            self.tell_coupling(q, v)
        except BaseException as error:
            self._error, told.command[:], told.outer[:] = error, np.nan, np.nan

    def _act(self, q: FloatArray, v: FloatArray, step: float) -> None:
        """Tell what the effects do in the middle of a part of h [s], at q (nq,) and v (nv,).

        Without T of the gears, effects take what they remember of it.
        """
        state, now, told = self._given, self.plant.now, self.plant.forces
        stage, time = int(now.numbers[tables.STAGE]), now.numbers[tables.TIME] + 0.5 * step
        mesh = None if np.isnan(told.mesh).any() or not len(told.mesh) else told.mesh.copy()
        motion = Motion(q, v, None, np.asarray(time), self.temperature, mesh_torque=mesh)
        memory, rotor = _memory_at(state.memory, self.acts, stage), now.command.copy()
        seen, following = [motion] * len(self.hooks), [*memory]
        for total in (told.outer, told.dry, told.added):
            total[:] = 0.0
        for i, effect in enumerate(self.hooks):
            own = memory[i] if memory else None
            if own is not None:
                seen[i] = motion.replace(memory=Memory(own, step))
                following[i] = effect.next_memory(self.robot, seen[i], rotor)
            rotor = effect.drive(self.robot, seen[i], rotor)
            add_torques(self.robot, effect, seen[i], (told.outer, told.dry, told.added))
        self.acts[stage] = tuple(following), tuple(seen)
        told.command[:] = rotor

    def _take_more(self) -> None:
        """Give the loops more memory."""
        words, heap = np.empty(2 * int(self._heap.used[1])), cast(Any, self._heap)
        heap.exchange("words", words)
        heap.exchange("whole", words.view(np.int64))

    def _take_more_stages(self) -> None:
        """Give the loops room for more stages of a step."""
        stages = np.concatenate([self.plant.stages, np.zeros_like(self.plant.stages)])
        cast(Any, self.plant).exchange("stages", stages)

    def _address(self, answer: Callable[[], None]) -> int:
        """Return the address of a function that loops may ask."""
        self._answers.append(_Answer(answer))
        return int(ctypes.cast(self._answers[-1], ctypes.c_void_p).value or 0)

    def begin(self, state: SimState, step: float, external: FloatArray | None) -> SimState:
        """Tell the loops what acts over a step h [s] that starts in a state.

        Return it with the memory of effects, their first one where it has none.

        Raises:
            SimulationError: the memory belongs to other effects than these.
        """
        given, first = state.memory, self.first_memory
        if not given and first:
            state = state.replace(memory=first)
        elif given and [m is None for m in given] != [m is None for m in first]:
            own = [e.name for e in self.hooks if e.first_memory(self.robot) is not None]
            raise SimulationError(
                f"the memory of the state does not fit '{self.robot.name}' (effects with a memory: "
                f"{', '.join(own) or 'none'}); it comes from a plant with other effects. Leave it "
                "empty to start anew."
            )
        if self.waits:
            self._given, self.acts = state, {}
        numbers = self.plant.now.numbers
        numbers[tables.TIME], numbers[tables.LENGTH] = state.time, step
        self.plant.forces.external.fill(0.0)
        if external is not None:
            self.plant.forces.external[:] = external
        return state

    def now_at(self, words: FloatArray) -> Any:
        """Return what `Now` held where a stage starts, or the step ends, by the names of fields."""
        return np.ndarray((), self._now_kind, words)

    def state_at(
        self, first: EffectMemory, stages: FloatArray, acts: Mapping[int, EffectActs], stage: int
    ) -> SimState:
        """Return the state in which a stage of a step starts.

        Args:
            first: memory of the effects at the start of the step.
            stages: (s + 1, w) of the step, see `Opened`.
            acts: what effects did in each part, by its stage.
            stage: its number; s for the end of the step.
        """
        now, memory = self.now_at(stages[stage]), _memory_at(first, acts, stage) if acts else first
        at = now["position"], now["velocity"], stages.item(stage, tables.TIME), now["closed"]
        return SimState(*at, now["impulse"], now["deflection"], now["motor_speed"], memory)

    def end_at(self, words: FloatArray) -> Any:
        """Return what `Ending` held at the end of a stage, by the names of its fields."""
        return np.ndarray((), self._end_kind, words, self._now_kind.itemsize)

    def heard(self) -> None:
        """Raise what the ground, or an effect, raised."""
        error, self._error = self._error, None
        if error is not None:
            raise error

    def gaps(self, position: FloatArray) -> FloatArray:
        """Return all gaps (2 j + c,) at q (nq,)."""
        gap = np.empty(self.barriers.size)
        gaps_of(self.plant, np.ascontiguousarray(position), gap)
        self.heard()
        return gap

    def survey(self, state: SimState) -> tuple[float, float, int]:
        """Return stored energy [J], the gap of the deepest body [m], and which that is."""
        self.tell_coupling(state.position, state.velocity)
        numbers = state.position, state.velocity, *self.drive.motion(state)
        return survey(self.plant, *map(np.ascontiguousarray, numbers))

    def coupling(self, position: FloatArray, velocity: FloatArray) -> RotorCoupling | None:
        """Return the inertial coupling at (q, v); None where rotors only feel their own spin."""
        if not self.robot.rotors_turn_with_links:
            return None
        model, data = self.space.model, self.space.data
        pin.forwardKinematics(model, data, position, velocity, np.zeros(model.nv))
        pin.computeJointJacobians(model, data, position)
        return rotor_coupling(self.robot, velocity, data)

    def tell_coupling(self, position: FloatArray, velocity: FloatArray) -> None:
        """Give the loops the inertial coupling at (q, v), at the motor outputs."""
        found = self.coupling(position, velocity)
        if found is not None:
            told, ratio, nv = self.plant.gears, self.drive.gears.gear_ratio, len(velocity)
            told.coupling[:] = ratio[:, None] * found.inertia
            told.gyration[0, :nv] = found.link_bias
            told.gyration[0, nv:] = ratio * found.rotor_bias

    def _check_rotors(self, inertia: FloatArray) -> None:
        """Refuse rotors that spin more inertia than the links that carry them have.

        The links' inertia H (nv, nv) holds that of their rotors at standstill. Without it,
        H - C' I_r^-1 C with the rows C of the coupling, nothing negative may be left: the kinetic
        energy would be.

        Raises:
            SimulationError: the kinetic energy can be negative; it names the heaviest rotor.
        """
        robot, at_rest = self.robot, np.zeros(self.space.model.nv)
        found = self.coupling(robot.neutral(), at_rest)
        if found is None:
            return
        spin = robot.transmission.rotor_inertia
        turning = found.inertia[spin > 0.0] / np.sqrt(spin[spin > 0.0])[:, None]
        shares = turning @ np.linalg.solve(inertia, turning.T)
        if np.linalg.eigvalsh(shares).max(initial=0.0) >= 1.0:
            names = [j for j, own in zip(robot.transmission.joints, spin, strict=True) if own > 0.0]
            worst = int(np.argmax(np.diag(shares)))
            raise SimulationError(
                f"'{robot.name}': the rotor of '{names[worst]}' has {shares[worst, worst]:.3g} "
                "times the inertia that its housing has about the rotor's axis, all rotors "
                "together more than their housings: the kinetic energy can be negative. Links "
                "contain the inertia of their rotors at standstill: give the links more, or the "
                "rotors less."
            )


def _memory_at(memory: EffectMemory, acts: Mapping[int, EffectActs], stage: int) -> EffectMemory:
    """Return the memory of the effects where a stage starts, from that at the start of a step."""
    for number, (following, _) in acts.items():
        memory = following if number < stage else memory
    return memory


def _memory(structure: Structure, sizes: Mapping[str, int]) -> tuple[Any, Any]:
    """Return a structure of new arrays, and how those before its words lie there."""
    names = list(structure.kind.fields)
    kept = names[: names.index("words")]
    shown = vars(structure.of(sizes, words=np.empty(0)))
    layout = np.dtype([(name, shown[name].dtype, shown[name].shape) for name in kept], align=True)
    words = np.zeros(layout.itemsize // 8)
    record = np.ndarray((), layout, words)
    return structure.of(sizes, words=words, **{name: record[name] for name in kept}), layout
