"""The plant: a robot on a terrain that steps from state to state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite
from typing import TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, checked
from wbc.errors import SimulationError
from wbc.robot import Robot
from wbc.sim.energy.kinetic_energy import kinetic_energy
from wbc.sim.ground.barriers import TOUCH
from wbc.sim.ground.plane import Plane
from wbc.sim.ground.terrain import Terrain
from wbc.sim.laws.motor_motion import MotorMotion, rotor_motion
from wbc.sim.setup import Setup, prepare
from wbc.sim.state import SimState
from wbc.sim.step.collision import settle
from wbc.sim.step.flow import Flow, flow
from wbc.sim.step.forces import checked_memory
from wbc.sim.step.impact import Impact
from wbc.sim.step.step_result import StepResult

_MAX_PARTS = 12

MotorBounds: TypeAlias = Callable[[Robot, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class Plant:
    """A robot on a terrain, stepped by one convex program per step (docs/physics.md).

    `step` is a function of its arguments alone: the same state, torque and step give the same
    result to the last bit. The plant keeps memory to work in; use one per thread.

    Attributes:
        robot: what moves.
        terrain: what it stands on.
        restitution: normal speed after over before an impact (Newton), 0 to 1; less in an impact
            that would gain energy from it (`Impact.restitution`).
        motor_bounds: least and greatest rotor torque (m,) [N m] of a robot's motors at rotor
            speeds (m,) [rad/s], at the start of a step; None for the robot's `torque_limit` at
            every speed. `RotorTorqueLimit(knee=...).bounds` gives motors a torque-speed curve.
    """

    robot: Robot
    terrain: Terrain = field(default_factory=Plane)
    restitution: float = 0.0
    motor_bounds: MotorBounds | None = None
    _setup: Setup = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Prepare what does not change from step to step."""
        if not 0.0 <= self.restitution <= 1.0:
            raise SimulationError(f"restitution must lie in [0, 1], got {self.restitution:g}.")
        gears = self.robot.transmission
        light = (gears.backward_efficiency < 0.0) & (gears.rotor_inertia == 0.0)
        if light.any():
            name = gears.joints[int(np.flatnonzero(light)[0])]
            raise SimulationError(
                f"the gear of '{name}' is self-locking (backward efficiency < 0) and has no rotor "
                "inertia: while it turns, its motion is not determined. Give rotor_inertia."
            )
        object.__setattr__(self, "_setup", prepare(self.robot, self.terrain, self.restitution))

    def state(self, position: ArrayLike, velocity: ArrayLike | None = None) -> SimState:
        """Return a state to start from, at time zero.

        Args:
            position: q (nq,).
            velocity: v (nv,), default at rest.

        Raises:
            SimulationError: wrong shapes, or a value that is not finite.
        """
        model = self.robot.model
        v = np.zeros(model.nv) if velocity is None else velocity
        return SimState(
            checked(position, (model.nq,), "position q", SimulationError),
            checked(v, (model.nv,), "velocity v", SimulationError),
        )

    def step(
        self,
        state: SimState,
        rotor_torque: ArrayLike,
        dt: float,
        external: FloatArray | None = None,
    ) -> StepResult:
        """Return what the plant does in `dt` seconds under a constant command.

        A point that lands within the step, or a joint that reaches its limit, splits it: the
        plant flows to the touchdown, takes the impact there, and flows on.

        Args:
            state: where it starts.
            rotor_torque: (m,) [N m] commanded on the rotors; the motors give at most their bounds.
            dt: [s].
            external: generalised force (nv,) from outside, None for none.

        Raises:
            SimulationError: the command or dt is not usable, or the step has no unique solution.
        """
        setup, command = self._setup, self._command(state, rotor_torque, dt)
        parts: list[Flow] = []
        impacts: list[Impact] = []
        impact = None
        if state.memory or setup.memory:
            state = state.replace(memory=checked_memory(setup.robot, setup.memory, state.memory))
        if len(state.closed) != setup.barriers.size:
            state, impact = settle(setup, state)
        left = dt
        while True:
            if impact is not None:
                impacts.append(impact)
            part = flow(setup, state, command, left, external)
            if len(parts) < _MAX_PARTS and _lands(state, part):
                part = self._until_landing(state, command, part, left, external)
            parts.append(part)
            left -= part.state.time - state.time
            if left <= 1e-9 * dt:
                break
            state, impact = settle(setup, part.state)
        return StepResult(part.state, dt, command, tuple(parts), tuple(impacts))

    def run(
        self,
        state: SimState,
        rotor_torque: ArrayLike,
        dt: float,
        steps: int,
        external: FloatArray | None = None,
    ) -> StepResult:
        """Return what the plant does in `dt` seconds, taken in several steps."""
        results = []
        for _ in range(steps):
            results.append(self.step(state, rotor_torque, dt / steps, external))
            state = results[-1].state
        return results[0] if steps == 1 else StepResult.joined(results)

    def mechanical_energy(self, state: SimState) -> float:
        """Return the kinetic energy of links and rotors, gravity's and the gear springs' [J]."""
        setup = self._setup
        motor = MotorMotion.of(setup.drive, state)
        height = pin.computePotentialEnergy(setup.space.model, setup.space.data, state.position)
        kinetic = kinetic_energy(setup, state.position, state.velocity, motor.speed)
        return float(kinetic + height + setup.drive.spring_energy(motor.deflection))

    def encoders(self, state: SimState) -> SimState:
        """Return the state with q and v as encoders on the motors show them.

        They differ from the joints' where gears are compliant or have play; feed them back to
        controllers whose robot has its encoders there.
        """
        robot, drive = self.robot, self._setup.drive
        if not drive.any_loose:
            return state
        angle, speed = rotor_motion(drive, robot.actuated_position, state)
        position, velocity = np.array(state.position), np.array(state.velocity)
        gears = robot.transmission
        position[robot.actuated_position] = gears.joints_from_rotors(angle)
        velocity[robot.actuated] = gears.joints_from_rotors(speed)
        return state.replace(position=position, velocity=velocity)

    def gaps(self, state: SimState) -> FloatArray:
        """Return the distance (k,) of the contact points from the ground [m]."""
        space, barriers = self._setup.space, self._setup.barriers
        pin.forwardKinematics(space.model, space.data, state.position)
        return barriers.clearance(state.position).gap[barriers.limits :]

    def _command(self, state: SimState, rotor_torque: ArrayLike, dt: float) -> FloatArray:
        if not dt > 0.0:
            raise SimulationError(f"the step dt must be positive, got {dt}.")
        gears = self.robot.transmission
        torque = np.asarray(rotor_torque, dtype=np.float64)
        if torque.shape != (gears.size,):
            raise SimulationError(
                f"rotor_torque has shape {torque.shape}; '{self.robot.name}' has {gears.size} "
                f"rotors: {', '.join(gears.joints)}."
            )
        if not all(map(isfinite, torque.tolist())):
            raise SimulationError(f"rotor_torque holds a value that is no number: {torque}.")
        if self.motor_bounds is None:
            return np.minimum(np.maximum(torque, -gears.torque_limit), gears.torque_limit)
        speed = gears.gear_ratio * MotorMotion.of(self._setup.drive, state).speed
        low, high = self.motor_bounds(self.robot, speed)
        return np.minimum(np.maximum(torque, low), high)

    def _until_landing(
        self,
        state: SimState,
        command: FloatArray,
        part: Flow,
        step: float,
        external: FloatArray | None,
    ) -> Flow:
        """Return the flow that ends where the first barrier is reached (regula falsi)."""
        space, barriers = self._setup.space, self._setup.barriers
        pin.forwardKinematics(space.model, space.data, state.position)
        ahead = ~state.closed
        early, late = 0.0, step
        gap_early = barriers.clearance(state.position).gap[ahead]
        gap_late = part.gap[ahead]
        for _ in range(40):
            share = _first_crossing(gap_early, gap_late)
            trial = early + share * (late - early)
            part = flow(self._setup, state, command, trial, external)
            gap = part.gap[ahead]
            if abs(gap.min()) <= 0.5 * TOUCH:
                break
            if gap.min() > 0.0:
                early, gap_early = trial, gap
            else:
                late, gap_late = trial, gap
        return part


def _lands(state: SimState, part: Flow) -> bool:
    if min(part.gap.tolist(), default=0.0) >= -TOUCH:
        return False
    return bool((part.gap[~state.closed] < -TOUCH).any())


def _first_crossing(early: FloatArray, late: FloatArray) -> float:
    """Return the share of the way at which the first gap closes, linearly between two ends."""
    crossing = late < 0.0
    ahead = np.maximum(early[crossing], 0.0)
    share = float((ahead / (ahead - late[crossing])).min())
    return min(max(share, 1e-4), 1.0 - 1e-4)
