"""A humanoid that steps: a plan of the capture point is followed, one foot at a time swings."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp, sqrt

import numpy as np
import pinocchio as pin

from sims.footsteps import DOUBLE, SINGLE, START, equal_steps, planned
from sims.legged import feet
from sims.trotter import StepUp, hump, minimum_jerk
from wbc import Robot
from wbc.arrays import FloatArray
from wbc.control import (
    CapturePointTask,
    CenterOfMassTask,
    Command,
    ContactRamp,
    Controller,
    ControllerSettings,
    FrameOrientationTask,
    FramePositionTask,
    PostureTask,
    Reference,
    RestPolicy,
    State,
)

SIDES = ("left", "right")
TRUNK, PELVIS = "torso_2_link", "base_link"
_CLEARANCE = 0.05  # [m] of a swing
_EARLY = 0.7  # share of a swing after which a foot that touches stands
_DOWN = 0.1  # [m/s] at which a foot that is late goes on down
_STIFFNESS = 5.0  # [1/s] with which the capture point follows the plan
_REACH = np.array([0.3, 0.2])  # [m] that a foothold may move, ahead or back and outwards
_INWARDS = 0.03  # [m] that it may move towards the other foot
_TOUCH = 1e-3  # [m] above the ground within which a corner of a sole counts as touching


@dataclass
class Stepper:
    """The loop's controller for steps of TALOS along x.

    Attributes:
        model: robot model that the controller obeys.
        pose: q (nq,) in which it stands with both soles side by side.
        steps: number of steps, the left foot first.
        length: [m] of a step; 0 on the spot.
        tick: time between two calls [s].
        adjusts: whether footholds answer to an error of the capture point that a sole cannot hold.
        policy: what gears at rest shall give.
        ground: that the robot walks on, and knows; its step is taken with one foot after the other.
    """

    model: Robot
    pose: FloatArray
    steps: int = 4
    length: float = 0.0
    tick: float = 1e-3
    adjusts: bool = True
    policy: RestPolicy = RestPolicy.NEUTRAL
    ground: StepUp = field(default_factory=StepUp)
    commands: list[Command] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the plan, the tasks and the controller."""
        self._data = self.model.model.createData()
        soles = feet(self.model)
        corner = {c.name: c for c in self.model.contacts}
        names = {s: [n for n in corner if n.startswith(s)] for s in SIDES}
        self._corners = {s: np.array([corner[n].offset for n in names[s]]) for s in SIDES}
        self._frame = {s: self.model.model.getFrameId(corner[names[s][0]].frame) for s in SIDES}
        self._read(self.pose, np.zeros(self.model.model.nv))
        center = np.array(self._data.com[0])
        self._height = center[2:]
        self._pole = sqrt(9.81 / center[2])
        self._middle = np.array([self._corners[s].mean(axis=0) for s in SIDES])
        places = np.array([self._sole(s).mean(axis=0)[:2] for s in SIDES])
        self._level = float(self._data.oMf[self._frame["left"]].translation[2])
        self.plan = planned(places, self._ahead(places), self._pole, self.tick, self.ground)
        weight = 9.81 * pin.computeTotalMass(self.model.model)
        self._ramp = ContactRamp(list(SIDES), 1.5 * weight, DOUBLE)
        frames = {s: corner[names[s][0]].frame for s in SIDES}
        tasks = [
            CapturePointTask(weight=100.0, stiffness=_STIFFNESS, height=float(center[2])),
            CenterOfMassTask(
                name="height",
                axes="z",
                weight=100.0,
                stiffness=100.0,
                acceleration_limit=np.inf,
            ),
            FrameOrientationTask(name="trunk", frame=TRUNK, weight=10.0, stiffness=100.0),
            FrameOrientationTask(name="pelvis", frame=PELVIS, weight=10.0, stiffness=100.0),
            *[
                FramePositionTask(name=s, frame=frames[s], weight=100.0, stiffness=900.0)
                for s in SIDES
            ],
            *[
                FrameOrientationTask(
                    name=f"{s} level", frame=frames[s], weight=30.0, stiffness=900.0
                )
                for s in SIDES
            ],
            PostureTask.of(self.model, weight=0.1, stiffness=50.0),
        ]
        settings = ControllerSettings(time_step=self.tick, rest_policy=self.policy)
        self._controller = Controller(self.model, tasks, soles, settings=settings)
        self._starts: dict[str, FloatArray] = {}
        self._time, self.done = 0.0, 0
        corners = self._corners["left"][:, :2]
        half = 0.5 * (corners.max(axis=0) - corners.min(axis=0))
        self._held = half / (1.0 + _STIFFNESS / self._pole)
        self._moved, self._aside = np.zeros(2), np.zeros(2)  # of the whole plan, of this step

    def __call__(self, state: State) -> FloatArray:
        """Return the rotor torque for a state, one tick after the last call."""
        self._read(state.position, state.velocity)
        standing, swinging, share = self._phases()
        now = min(round(self._time / self.tick), len(self.plan.point) - 1)
        if swinging is not None and share <= 1.0 and self.adjusts:
            self._aside = self._answer(swinging, now, (1.0 - share) * SINGLE)
        rise, climb, curve = self.plan.rise[now][:, None]
        references = {
            "capture_point": Reference(self.plan.point[now] + self._moved, self.plan.rate[now]),
            "height": Reference(self._height + rise, climb, curve),
            "trunk": Reference(np.eye(3)),
            "pelvis": Reference(np.eye(3)),
        }
        if swinging is not None:
            references[swinging] = self._swing(swinging, share)
            references[f"{swinging} level"] = Reference(np.eye(3))
        on = {name: float(s == swinging) for s in SIDES for name in (s, f"{s} level")}
        ceilings = self._ramp.step(standing, self.tick)
        if swinging is not None:
            ceilings = {s: c for s, c in ceilings.items() if s != swinging}
        command = self._controller.step(state, references, ceilings, activation=on)
        self.commands.append(command)
        self._time += self.tick
        return command.rotor_torque

    def point_error(self) -> FloatArray:
        """Return the capture point less the planned one (2,) [m] at the last call's state."""
        return self._error(min(round(self._time / self.tick) - 1, len(self.plan.point) - 1))

    def height_error(self) -> float:
        """Return the centre of mass' height less the planned one [m] at the last call's state."""
        now = min(round(self._time / self.tick) - 1, len(self.plan.point) - 1)
        return float(self._data.com[0][2] - self._height[0] - self.plan.rise[now, 0])

    def _ahead(self, places: FloatArray) -> list[float]:
        """Return how far ahead every step leads, [m] from the start.

        Both feet step over the edge of a step, one beside the other, before the way goes on.
        """
        if not self.ground.height:
            return equal_steps(self.steps, self.length)
        heel = float(self._corners["left"][:, 0].min() - self._middle[0][0])
        over = self.ground.edge + self.ground.margin - heel - float(places[:, 0].mean())
        rest = equal_steps(self.steps - 2, self.length)
        return [over, over, *(over + way for way in rest)][: self.steps]

    def _error(self, now: int) -> FloatArray:
        point = self._data.com[0][:2] + self._data.vcom[0][:2] / self._pole
        return np.array(point - self.plan.point[now] - self._moved)

    def _answer(self, side: str, now: int, left: float) -> FloatArray:
        """Return how far the foothold moves, (2,) [m], with `left` [s] of the swing to go.

        Against an error e of the capture point the task moves the centre of pressure by
        e (1 + stiffness / pole), at most by half the sole: it takes back errors up to d. What is
        beyond grows, to (e - d) exp(pole left) when the foot lands, and that is where it lands.
        """
        error = self._error(now)
        beyond = np.sign(error) * np.maximum(np.abs(error) - self._held, 0.0)
        moved = np.clip(beyond * exp(self._pole * left), -_REACH, _REACH)
        inwards = -1.0 if side == "left" else 1.0
        if moved[1] * inwards > _INWARDS:
            moved[1] = inwards * _INWARDS
        return np.asarray(moved)

    def _read(self, q: FloatArray, v: FloatArray) -> None:
        pin.centerOfMass(self.model.model, self._data, q, v)
        pin.updateFramePlacements(self.model.model, self._data)

    def _sole(self, side: str) -> FloatArray:
        """Return where the corners of a sole are (4, 3) [m]."""
        place = self._data.oMf[self._frame[side]]
        return np.array([place.act(corner) for corner in self._corners[side]])

    def _clear(self, side: str) -> float:
        """Return how far the lowest corner of a sole is above the ground [m]."""
        return min(float(z) - self.ground.at(float(x)) for x, _, z in self._sole(side))

    def _phases(self) -> tuple[set[str], str | None, float]:
        """Return the feet that shall bear, the one in the air and the share of its swing.

        A foot gives off its load while both stand. It lifts when it bears none.
        """
        clock = self._time - START
        step = int(clock // (SINGLE + DOUBLE))
        if self._starts:
            step = self.done  # also when the foot is late
        within = clock - step * (SINGLE + DOUBLE)
        if clock < 0.0 or step >= self.steps or self.done > step:
            return set(SIDES), None, 0.0
        side = SIDES[step % 2]
        rest = {SIDES[1 - step % 2]}
        if within < DOUBLE:
            return rest, None, 0.0
        share = (within - DOUBLE) / SINGLE
        if side not in self._starts:
            self._starts = {side: np.array(self._data.oMf[self._frame[side]].translation)}
        if share > _EARLY and self._clear(side) < _TOUCH:
            self.done, self._starts = step + 1, {}
            self._moved, self._aside = self._moved + self._aside, np.zeros(2)
            return set(SIDES), None, 0.0
        return rest, side, share

    def _swing(self, side: str, share: float) -> Reference:
        """Return where a foot in the air should be."""
        start, index = self._starts[side], SIDES.index(side)
        hold = self.plan.holds[self.done + 1][index] + self._moved + self._aside
        level = self._level + self.ground.at(float(hold[0]))
        end = np.array([*(hold - self._middle[index][:2]), level])
        if share > 1.0:
            down = np.array([0.0, 0.0, _DOWN])
            return Reference(end - (share - 1.0) * SINGLE * down, -down)
        path, slope, bend = minimum_jerk(max(share, 0.0))
        rise, climb, curve = hump(share)
        way, above = end - start, np.array([0.0, 0.0, _CLEARANCE])
        return Reference(
            start + path * way + rise * above,
            (slope * way + climb * above) / SINGLE,
            (bend * way + curve * above) / SINGLE**2,
        )
