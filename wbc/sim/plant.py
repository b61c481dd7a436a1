"""The plant: a robot on a terrain that steps from state to state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, Ranged, checked, must
from wbc.compiled import make_ready
from wbc.errors import RobotError, SimulationError
from wbc.mechanics.newton import SEVERAL
from wbc.robot import BodySurface, ContactPoint, Robot, body_surfaces
from wbc.robot.body_contacts import Hull
from wbc.sim.ground import Plane, Terrain
from wbc.sim.result import StepResult
from wbc.sim.setup import Setup
from wbc.sim.step.course import NO_COMMAND, take_step
from wbc.sim.step.pairs import FAR
from wbc.sim.step.part import lift
from wbc.sim.step.part_rows import NO_INERTIA
from wbc.sim.step.tables import STAGE, TOUCH, SimState

MotorBounds: TypeAlias = Callable[[Robot, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class HuntCrossley(Ranged):
    """Hunt and Crossley's compliant contact, F = K d^(3/2) (1 + 3/2 a d') (`mechanics/laws`).

    A body that arrives at a low speed v leaves at about (1 - a v) v.

    Attributes:
        stiffness: K [N/m^(3/2)] of each contact point; 4/3 E* sqrt(R) for a ball of radius R
            on flat ground (Hertz), where 1/E* sums (1 - nu^2)/E of both materials.
        dissipation: a [s/m]; 0.08 to 0.32 for steel, bronze and ivory (Hunt and Crossley 1975).
    """

    stiffness: float = field(metadata=must("> 0 N/m^(3/2) and < inf"))
    dissipation: float = field(default=0.0, metadata=must(">= 0 s/m and < inf"))

    _told, _raised = "compliant contacts: ", SimulationError


@dataclass(frozen=True, eq=False)
class Plant(Ranged):
    """A robot on a terrain, stepped by one convex program per step (docs/method/physics.md).

    `step` is a function of its arguments alone: the same state, torque and step give the same
    result to the last bit. The plant keeps memory to work in; use one per thread.

    Attributes:
        robot: what moves.
        terrain: what it stands on.
        restitution: normal speed after over before an impact (Newton), 0 to 1; less in an impact
            that would gain energy from it (`Impact.restitution`).
        return_speed: speed [m/s, rad/s] at which an overlap is taken back at most; it moves the
            robot and gives it no velocity. What is left after a step is an event of its result.
        motor_bounds: least and greatest rotor torque (m,) [N m] of a robot's motors at rotor
            speeds (m,) [rad/s], at the start of a step; None for the robot's `torque_limit` at
            every speed. `RotorTorqueLimit(knee=...).bounds` gives motors a torque-speed curve.
        temperature: (m,) of the motors [deg C], as effects and the recording see it; None where
            it does not matter.
        bodies: what touches the ground: "feet", the robot's contacts, or "all", also its links, as
            the collision geometry of its model file has them (`wbc.robot.body_surfaces`); None for
            all where there is such geometry.
        compliance: of the contacts; None for rigid ones, with impacts.
        contacts: what touches: the robot's contacts, then the points of its links.
    """

    robot: Robot
    terrain: Terrain = field(default_factory=Plane)
    restitution: float = field(default=0.0, metadata=must(">= 0 and <= 1"))
    return_speed: float = field(default=1.0, metadata=must("> 0 m/s"))
    motor_bounds: MotorBounds | None = None
    temperature: FloatArray | None = None
    bodies: Literal["feet", "all"] | None = None
    compliance: HuntCrossley | None = None
    contacts: tuple[ContactPoint, ...] = field(init=False, repr=False)
    _setup: Setup = field(init=False, repr=False)

    _told, _raised = "plant: ", SimulationError

    def __post_init__(self) -> None:
        """Prepare what does not change from step to step."""
        if self.bodies not in ("feet", "all", None):
            raise SimulationError(f'bodies: "feet" or "all" expected, got {self.bodies!r}.')
        points, hulls = self._surfaces()
        object.__setattr__(self, "contacts", (*self.robot.contacts, *points))
        touching = replace(self.robot, contacts=self.contacts) if points else self.robot
        self.robot.require_tree()
        make_ready("wbc.sim")
        super().__post_init__()
        gears = self.robot.transmission
        light = (gears.backward_efficiency < 0.0) & (gears.rotor_inertia == 0.0)
        if light.any():
            name = gears.joints[int(np.flatnonzero(light)[0])]
            raise SimulationError(
                f"the gear of '{name}' is self-locking (backward efficiency < 0) and has no rotor "
                "inertia: while it turns, its motion is not determined. Give rotor_inertia."
            )
        soft = (0.0, 0.0) if self.compliance is None else astuple(self.compliance)
        bounds = np.array([self.return_speed, *soft, 0.0, self.restitution])
        if self.temperature is not None:
            warm = checked(self.temperature, (gears.size,), "motor temperature", SimulationError)
            object.__setattr__(self, "temperature", warm)
        setup = Setup(touching, self.terrain, hulls, self.temperature, bounds)
        object.__setattr__(self, "_setup", setup)

    def _surfaces(self) -> tuple[tuple[ContactPoint, ...], tuple[Hull, ...]]:
        """Return points and hulls of the links, none of feet alone.

        Raises:
            RobotError: all bodies are asked for, and there is no geometry of them.
        """
        if self.bodies == "feet":
            return (), ()
        try:
            return body_surfaces(self.robot)
        except RobotError:
            if self.bodies == "all" or self.robot.surface != BodySurface():
                raise
            return (), ()

    def state(
        self, position: ArrayLike, velocity: ArrayLike | None = None, *, lifted: bool = False
    ) -> SimState:
        """Return a state to start from, at time zero.

        A state in the ground or beyond a joint limit can be asked for its `gaps`; the first step
        from it is refused.

        Args:
            position: q (nq,).
            velocity: v (nv,), default at rest.
            lifted: move a robot that starts in the ground or beyond a joint limit out of it: joints
                to their limits, then all of it by the least motion, of the base where it is free.

        Raises:
            SimulationError: wrong shapes, a value that is not finite, or no way out of the ground.
        """
        model = self.robot.model
        v = np.zeros(model.nv) if velocity is None else velocity
        q = checked(position, (model.nq,), "position q", SimulationError)
        if lifted:
            q = self._lifted(q)
        return SimState(q, checked(v, (model.nv,), "velocity v", SimulationError))

    def step(
        self,
        state: SimState,
        rotor_torque: ArrayLike,
        dt: float,
        external: FloatArray | None = None,
    ) -> StepResult:
        """Return what the plant does in `dt` seconds under a constant command.

        A point that lands within the step, or a joint that reaches its limit, splits it: the
        plant flows to the touchdown, takes the impact there, and flows on. Some barriers are
        kept as rows instead, which may close but not be passed, for what is left of the step: one
        that is hit again within the step (it bounces faster than the step can tell, so its second
        impact has no restitution), one that lands slowly (its impact comes at the end), and one
        whose gap jumps. So every barrier that closes is kept, in finitely many parts.

        Args:
            state: where it starts.
            rotor_torque: (m,) [N m] commanded on the rotors; the motors give at most their bounds.
            dt: [s].
            external: generalised force (nv,) from outside, None for none.

        Raises:
            SimulationError: the command or dt is not usable, or the step has no unique solution.
        """
        setup, torque = self._setup, self._command(state, rotor_torque, dt)
        state = setup.begin(state, dt, external)
        q, v, _, closed, push, bent, spin, _ = state
        if len(closed) != setup.barriers.size:
            self._check_outside(setup.gaps(q)[: setup.plant.obstacles.rigid])
        failed = take_step(setup.plant, q, v, push, bent, spin, closed, torque)
        stages = setup.plant.stages[: int(setup.plant.now.numbers.item(STAGE)) + 1].copy()
        setup.heard()
        if failed:
            raise self._failure(failed, torque)
        end = setup.state_at(state.memory, stages, setup.acts, len(stages) - 1)
        return StepResult(setup, state, end, dt, stages, setup.acts)

    def run(
        self,
        state: SimState,
        rotor_torque: ArrayLike,
        dt: float,
        steps: int,
        external: FloatArray | None = None,
    ) -> list[StepResult]:
        """Return the results of several steps, together `dt` seconds, under a constant command."""
        results: list[StepResult] = []
        for _ in range(steps):
            results.append(self.step(state, rotor_torque, dt / steps, external))
            state = results[-1].state
        return results

    def mechanical_energy(self, state: SimState) -> float:
        """Return the kinetic energy of links and rotors, gravity's and the gear springs' [J]."""
        return self._setup.survey(state)[0]

    def encoders(self, state: SimState) -> SimState:
        """Return the state with q and v as encoders on the motors show them.

        They differ from the joints' where gears are compliant or have play; feed them back to
        controllers whose robot has its encoders there.
        """
        robot, drive = self.robot, self._setup.drive
        if not drive.any_loose:
            return state
        angle, speed = drive.rotors(state)
        position, velocity = np.array(state.position), np.array(state.velocity)
        gears = robot.transmission
        position[robot.actuated_position] = gears.joints_from_rotors(angle)
        velocity[robot.actuated] = gears.joints_from_rotors(speed)
        return state.replace(position=position, velocity=velocity)

    def gaps(self, state: SimState) -> FloatArray:
        """Return the distance (k,) of the contact points from the ground [m]."""
        told, poses = self._setup.barriers.obstacles, self._setup.plant.placed.poses
        self._setup.gaps(state.position)  # which places the bodies
        turns, own = poses[told["contact_at"]].reshape(-1, 4, 3), told["contacts"][:, :3, None]
        points = (turns[:, :3] @ own)[..., 0] + turns[:, 3]
        return self.terrain.gap(points)[0] - told["contacts"][:, 3]

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the p pairs of solids that may touch; what is no body is "ground"."""
        return self._setup.barriers.pairs

    def pair_gaps(self, state: SimState) -> FloatArray:
        """Return the distances (p,) of pairs of solids [m], infinite where they are far apart.

        Exact for round solids, and where corners, edges and faces of others face each other; corner
        and edge of two solids that are apart may be nearer.
        """
        barriers, gap = self._setup.barriers, self._setup.gaps(state.position)
        gap = np.where(gap < FAR, gap, np.inf)[barriers.size - len(barriers.bodies.slots) :]
        found = np.full(len(self.pairs), np.inf)
        np.minimum.at(found, barriers.bodies.slots[:, 0], gap)
        return found

    def _lifted(self, position: FloatArray) -> FloatArray:
        """Return q (nq,) moved out of the ground and to joint limits.

        Driven joints keep their angles where a free base can do it.

        Raises:
            SimulationError: a point that no motion brings out.
        """
        barriers, stiff = self._setup.barriers, np.zeros(self.robot.model.nv)
        stiff[self.robot.actuated] = 1.0
        q, at = np.array(position), barriers.obstacles["limit_at"][:, 0]
        q[at] = np.clip(q[at], *barriers.obstacles["limit_range"].T)
        done = lift(self._setup.plant, stiff, q)
        self._setup.heard()
        if not done:
            gap = self._setup.gaps(q)
            place = int(np.argmin(gap))
            raise SimulationError(
                f"'{self.robot.name}' cannot be lifted out of the ground: {barriers.names[place]} "
                f"starts {-gap[place]:.3g} m (rad) inside, and no motion of its free joints brings "
                "it out."
            )
        return q

    def _command(self, state: SimState, rotor_torque: ArrayLike, dt: float) -> FloatArray:
        """Return a command (m,) as an array, and tell the loops its bounds."""
        if not dt > 0.0:
            raise SimulationError(f"the step dt must be positive, got {dt}.")
        gears = self.robot.transmission
        torque = np.asarray(rotor_torque, dtype=np.float64)
        if torque.shape != (gears.size,):
            raise SimulationError(
                f"rotor_torque has shape {torque.shape}; '{self.robot.name}' has {gears.size} "
                f"rotors: {', '.join(gears.joints)}."
            )
        if self.motor_bounds is not None:
            speed, forces = self._setup.drive.motion(state)[1], self._setup.plant.forces
            forces.low[:], forces.high[:] = self.motor_bounds(self.robot, gears.gear_ratio * speed)
        return torque

    def _failure(self, code: int, torque: FloatArray) -> SimulationError:
        """Return the error for what `take_step` returned with a command (m,) [N m]."""
        plant, joints = self._setup.plant, self.robot.transmission.joints
        inertia, velocity, gears = plant.placed.inertia, plant.now.velocity, plant.gears
        if code == NO_COMMAND:
            told = f"rotor_torque holds a value that is no number: {torque}."
        elif code % 10 == NO_INERTIA or not np.isfinite(inertia).all():
            with np.errstate(all="ignore"):
                energy = 0.5 * float(velocity @ inertia @ velocity)
            told = "the step has no numbers: " if np.isnan(velocity).any() else ""
            told += (
                f"the state has blown up: {energy:.3g} J of kinetic energy, fastest coordinate "
                f"{np.abs(velocity).max(initial=0.0):.3g} rad/s (m/s). Look at the events of the "
                "steps before, and at the torques."
            )
        elif code % 10 == SEVERAL:
            falling = np.flatnonzero(gears.backward < 0.0).tolist()
            most = (gears.inertia / -gears.backward)[falling].min()
            told = (
                "the step has several solutions, or none that could be found, with the self-locking"
                f" gears {', '.join(repr(joints[i]) for i in falling)}: some turn against rotors "
                "too light for what their gears lock. Let the gears yield, as real teeth do "
                "(`stiffness`): with stiffness dt^2 / 4 + damping dt below "
                f"{most:.3g} kg m^2 every step has one solution. Or give them more rotor inertia, "
                "or backward efficiencies nearer to zero."
            )
        else:
            told = (
                "a step has no solution. Usual causes: a contact target that the joints cannot "
                "reach (a limit and the ground in conflict), or a self-locking gear whose falling "
                "branch leaves no solution; shorten the step or change the state."
            )
        return SimulationError(told)

    def _check_outside(self, gap: FloatArray) -> None:
        """Refuse a start inside the ground or beyond a joint limit, by gaps that do not yield.

        Raises:
            SimulationError: an overlap beyond TOUCH; it names the place and the depth.
        """
        barriers, depth = self._setup.barriers, -float(gap.min(initial=0.0))
        if depth <= TOUCH:
            return
        place = int(np.argmin(gap))
        beyond = f"{depth:.3g} rad (m) beyond its stop"
        inside = f"{1e3 * depth:.3g} mm inside the ground"
        raise SimulationError(
            f"the start of '{self.robot.name}' overlaps: {barriers.names[place]} is "
            f"{beyond if place < barriers.limits else inside}. Place the robot outside, or "
            "let the plant do it: plant.state(position, lifted=True)."
        )
