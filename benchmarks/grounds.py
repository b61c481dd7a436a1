"""One block in flight, on a slope and at a stair: this library, MuJoCo and Drake.

The same body in all three, with its corners as contacts (spheres of 0.1 mm where an engine has no
points), Coulomb friction, steps of 1 ms, and each engine's own contact as it comes: rigid here,
MuJoCo's default `solref`, Drake's default stiffness. `pip install drake` adds its column.
Run: python -m benchmarks.grounds
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Callable
from dataclasses import dataclass, field

import mujoco
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from benchmarks.controller import machine
from tests.reference.free_bodies import at, free_body
from wbc.sim import Plane, Plant, Stairs

STEP, HALF, MASS = 1e-3, np.array([0.1, 0.1, 0.05]), 1.0
CORNERS = np.array([HALF * [x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
RADIUS = 1e-4
ANGLE = np.deg2rad(25.0)


def uniform() -> np.ndarray:
    """Return the moments of inertia (3,) [kg m^2] of a uniform block."""
    squares = HALF**2
    return np.asarray(MASS / 3.0 * (squares.sum() - squares))


@dataclass(frozen=True)
class Scene:
    """What a block does.

    Attributes:
        time: [s].
        gravity: (3,) [m/s^2]; tilted instead of the ground.
        inertia: (3,) [kg m^2] about the block's axes.
        velocity, spin: (3,) [m/s], [rad/s] at the start, world axes.
        friction: coefficient.
        riser: x and height [m] of a stair, None for level ground.
        ground: whether there is any.
    """

    time: float
    gravity: np.ndarray
    friction: float = 0.0
    inertia: np.ndarray = field(
        default_factory=lambda: MASS / 3.0 * np.array([0.0125, 0.0125, 0.02])
    )
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    spin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    riser: tuple[float, float] | None = None
    ground: bool = True

    @property
    def start(self) -> np.ndarray:
        """(3,) [m] of the centre."""
        return np.array([0.0, 0.0, HALF[2] if self.ground else 50.0])


DOWN = np.array([0.0, 0.0, -9.81])
TILTED = 9.81 * np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)])
SCENES = {
    "flight": Scene(
        1.0,
        np.zeros(3),
        inertia=np.array([0.01, 0.02, 0.025]),
        velocity=np.array([3.0, 0.0, 0.0]),
        spin=np.array([6.0, 6.0, 5.3]),
        ground=False,
    ),
    "stick": Scene(1.0, TILTED, friction=0.6),
    "slide": Scene(1.0, TILTED, friction=0.2),
    "stair": Scene(0.6, DOWN, friction=0.1, velocity=np.array([1.0, 0, 0]), riser=(0.3, 0.06)),
}

Track = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Position (n, 3), rotation matrices (n, 3, 3), velocity (n, 3), spin (n, 3), world axes."""


def wbc_track(scene: Scene) -> Track:
    """Return the block's motion in this library's plant."""
    body = free_body(MASS, scene.inertia, [(corner, scene.friction, 0.0) for corner in CORNERS])
    ground: Plane | Stairs = Plane()
    if scene.riser is not None:
        ground = Stairs(np.array([scene.riser[0]]), np.array([0.0, scene.riser[1]]))
    plant = Plant(body.with_gravity(scene.gravity), ground)
    state = plant.state(at(scene.start), np.concatenate([scene.velocity, scene.spin]))
    rows = [state]
    for _ in range(round(scene.time / STEP)):
        rows.append(plant.step(rows[-1], np.zeros(0), STEP).state)
    q, v = (np.array([getattr(row, part) for row in rows]) for part in ("position", "velocity"))
    turn = Rotation.from_quat(q[:, 3:7])
    return q[:, :3], turn.as_matrix(), turn.apply(v[:, :3]), turn.apply(v[:, 3:])


def model_text(scene: Scene) -> str:
    """Return the scene as MJCF, which MuJoCo and Drake read."""
    numbers = {"gravity": scene.gravity, "inertia": scene.inertia, "start": scene.start}
    text = {name: " ".join(f"{x:.17g}" for x in values) for name, values in numbers.items()}
    touch = f'friction="{scene.friction} 0 0" condim="3"'
    ground = f'<geom name="ground" type="plane" size="9 9 1" {touch}/>' if scene.ground else ""
    if scene.riser is not None:
        x, z = scene.riser
        ground += f'<geom name="riser" type="box" size="2 2 {z}" pos="{x + 2.0} 0 0" {touch}/>'
    points = "".join(
        f'<geom name="c{i}" type="sphere" size="{RADIUS}" mass="0" {touch} '
        f'pos="{" ".join(map(str, corner - RADIUS * np.sign(corner)))}"/>'
        for i, corner in enumerate(CORNERS)
    )
    return f"""<mujoco model="scene">
      <option timestep="{STEP}" cone="elliptic" gravity="{text["gravity"]}"/>
      <worldbody>{ground}
        <body name="block" pos="{text["start"]}"><freejoint name="free"/>
          <inertial pos="0 0 0" mass="{MASS}" diaginertia="{text["inertia"]}"/>{points}</body>
      </worldbody></mujoco>"""


def mujoco_track(scene: Scene) -> Track:
    """Return the block's motion in MuJoCo."""
    model = mujoco.MjModel.from_xml_string(model_text(scene))
    data = mujoco.MjData(model)
    data.qvel[:] = np.concatenate([scene.velocity, scene.spin])
    rows = [(np.array(data.qpos), np.array(data.qvel))]
    for _ in range(round(scene.time / STEP)):
        mujoco.mj_step(model, data)
        rows.append((np.array(data.qpos), np.array(data.qvel)))
    q, v = (np.array(part) for part in zip(*rows, strict=True))
    turn = Rotation.from_quat(q[:, [4, 5, 6, 3]])
    return q[:, :3], turn.as_matrix(), v[:, :3], turn.apply(v[:, 3:])


def drake_track(scene: Scene) -> Track:
    """Return the block's motion in Drake."""
    from pydrake.multibody.math import SpatialVelocity
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=STEP)
    Parser(plant).AddModelsFromString(model_text(scene), "xml")
    plant.mutable_gravity_field().set_gravity_vector(scene.gravity)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    inner, body = plant.GetMyMutableContextFromRoot(context), plant.GetBodyByName("block")
    plant.SetFreeBodySpatialVelocity(inner, body, SpatialVelocity(scene.spin, scene.velocity))
    rows = []
    for k in range(round(scene.time / STEP) + 1):
        # The update at the end of a step belongs to the next one.
        simulator.AdvanceTo(max(k - 0.5, 0.0) * STEP)
        pose = plant.EvalBodyPoseInWorld(inner, body)
        speed = plant.EvalBodySpatialVelocityInWorld(inner, body)
        turn = pose.rotation().matrix()
        rows.append((pose.translation(), turn, speed.translational(), speed.rotational()))
    return tuple(np.array(part) for part in zip(*rows, strict=True))  # type: ignore[return-value]


def energy(scene: Scene, track: Track) -> np.ndarray:
    """Return kinetic and potential energy (n,) [J]."""
    position, turn, velocity, spin = track
    own = np.einsum("nij,ni->nj", turn, spin)
    kinetic = 0.5 * (MASS * (velocity**2).sum(axis=1) + (scene.inertia * own**2).sum(axis=1))
    return np.asarray(kinetic - MASS * position @ scene.gravity)


def depth(scene: Scene, track: Track) -> float:
    """Return the greatest depth of a corner in the ground [m]."""
    position, turn, *_ = track
    corners = position[:, None] + np.einsum("nij,kj->nki", turn, CORNERS)
    inside = -corners[..., 2]
    if scene.riser is not None:
        x, z = scene.riser
        under = np.minimum(z - corners[..., 2], corners[..., 0] - x)
        inside = np.maximum(inside, under)
    return float(inside.max())


def figures(track: Callable[[Scene], Track]) -> dict[str, float]:
    """Return what is compared."""
    found = {name: track(scene) for name, scene in SCENES.items()}
    flight, scene = found["flight"], SCENES["flight"]
    speed = np.linalg.norm(flight[2], axis=1)
    spin = np.einsum("nij,ni->nj", flight[1], flight[3])
    momentum = np.einsum("nij,nj->ni", flight[1], scene.inertia * spin)
    change = np.linalg.norm(momentum - momentum[0], axis=1).max() / np.linalg.norm(momentum[0])
    kinetic = energy(scene, flight)
    exact = 0.5 * 9.81 * (np.sin(ANGLE) - 0.2 * np.cos(ANGLE))
    stair = energy(SCENES["stair"], found["stair"])
    return {
        "flight: speed, largest change [%]": 100.0 * float(np.abs(speed / speed[0] - 1.0).max()),
        "flight: angular momentum, largest change [%]": 100.0 * float(change),
        "flight: energy, largest change [%]": 100.0 * float(np.abs(kinetic / kinetic[0] - 1).max()),
        "slope, friction holds: creep in 1 s [mm]": 1e3 * float(found["stick"][0][-1, 0]),
        "slope, slides: error of the way [%]": 100.0 * float(found["slide"][0][-1, 0] / exact - 1),
        "stair at 1 m/s: energy made in any step [mJ]": 1e3 * float(np.diff(stair).max()),
        "stair at 1 m/s: corner in the ground [mm]": 1e3 * depth(SCENES["stair"], found["stair"]),
    }


def main() -> dict[str, dict[str, float]]:
    """Print the table; return the figures per engine."""
    found = {"wbc": figures(wbc_track), "MuJoCo": figures(mujoco_track)}
    extra = ["mujoco"]
    try:
        found["Drake"] = figures(drake_track)
        extra.append("drake")
    except ImportError:
        print("Drake is not installed, its column is left out (pip install drake)")
    table = Table("", *found, title=f"a block, steps of {1e3 * STEP:g} ms")
    for name in found["wbc"]:
        table.add_row(name, *(f"{values[name]:.2g}" for values in found.values()))
    Console(width=110, markup=False).print(table)
    print(machine(*extra))
    return found


if __name__ == "__main__":
    main()
