"""A checkerboard held somewhere on the lot: its geoms in the world, the LiDAR's points on it.

The panel is a box, each black square another one that stands 0.2 mm before it: too thin to shift an edge in
the picture. Nobody holds it: a hand at its rim would hide little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float32, Float64

from fusion.calibrate_board import Board
from fusion.geometry import Transform
from scenarios.palette import palette
from scenarios.seeding import stream
from simbench.calibration.lot import Lot
from simbench.motion import Motion
from simbench.sensors import lidar, rays
from simbench.world import World

THICK_M = 0.02
FOIL_M = 0.0002
CUT_M = 0.15  # the points around the board are cut out so far beyond its corners, by hand
HAND_M = 0.05  # and that is how far beside its centre they are cut, at most


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """One sweep: all points in the LiDAR frame, and which of them lie on the board (truth)."""

    xyz_m: Float32[np.ndarray, "n 3"]
    on_board: Bool[np.ndarray, " n"]


def hold(lot: Lot, board: Board, T_world_board: Transform) -> Motion:
    """The lot with the board at a pose (see `fusion.calibrate_board` for its frame)."""
    return replace(lot.motion, world=_with_board(lot.motion.world, board, T_world_board, lot.seed))


def sweep_over(lot: Lot, held: Motion, *path: str) -> Sweep:
    """What the LiDAR measures of a held board; noise from the stream of `path`."""
    rng = stream(lot.seed, "calibration", *path, "lidar")
    scan, truth = lidar.sweep(lot.rig.lidar_name, lot.rig.lidar, held, 0, 0, rng)
    first = len(lot.motion.world.geom_object)
    return Sweep(xyz_m=scan.xyz_m, on_board=truth.part_id >= first)


def cut_out(
    sweep: Sweep, centre_lidar_m: Float64[np.ndarray, " 3"], board: Board, rng: np.random.Generator
) -> Float32[np.ndarray, "n 3"]:
    """The points around the board as a hand cuts them out: a ball about nearly its centre."""
    centre = centre_lidar_m + rng.uniform(-HAND_M, HAND_M, 3)
    reach_m = 0.5 * float(np.hypot(board.width_m, board.height_m)) + CUT_M
    return sweep.xyz_m[np.linalg.norm(sweep.xyz_m - centre, axis=1) <= reach_m]


def _with_board(world: World, board: Board, T_world_board: Transform, seed: int) -> World:
    """The same world with the board in it, after all other geoms; OpenGL's model does not have it."""
    columns, rows = np.meshgrid(np.arange(board.columns), np.arange(board.rows))
    x = (columns[board.black] + 0.5 - 0.5 * board.columns) * board.square_m
    y = (rows[board.black] + 0.5 - 0.5 * board.rows) * board.square_m
    black = len(x)
    centre = np.column_stack([np.append(0.0, x), np.append(0.0, y), np.zeros(black + 1)])
    centre[0, 2] = FOIL_M + 0.5 * THICK_M
    centre[1:, 2] = 0.5 * (FOIL_M + 0.5 * THICK_M)
    size = np.full((black + 1, 3), 0.5 * board.square_m)
    size[0] = 0.5 * board.width_m, 0.5 * board.height_m, 0.5 * THICK_M
    size[1:, 2] = centre[1:, 2]  # from the face at z = 0 into the panel
    materials = [palette()["board_white"], *[palette()["board_black"]] * black]
    reflectivity = {
        name: stream(seed, "calibration", "board", name).uniform(*palette()[name]["reflectivity"])
        for name in ("board_white", "board_black")
    }
    geoms, looks, count = world.geoms, world.looks, black + 1
    return replace(
        world,
        geoms=rays.Geoms(
            kind=np.append(geoms.kind, np.full(count, rays.BOX)),
            size_m=np.vstack([geoms.size_m, size]),
            body=np.append(geoms.body, np.zeros(count, dtype=np.int32)),
            rotation=np.concatenate([geoms.rotation, np.repeat(T_world_board.rotation[None], count, axis=0)]),
            position_m=np.vstack([geoms.position_m, T_world_board.apply(centre)]),
            bound_m=np.append(geoms.bound_m, np.linalg.norm(size, axis=1)),
        ),
        geom_model_id=np.append(world.geom_model_id, np.full(count, -1, dtype=np.int32)),
        geom_object=np.append(world.geom_object, np.full(count, len(world.objects), dtype=np.int32)),
        reflectivity=np.append(
            world.reflectivity, [reflectivity["board_white"], *[reflectivity["board_black"]] * black]
        ),
        roughness_gain=np.append(world.roughness_gain, np.zeros(count)),
        looks=replace(
            looks,
            colour=np.vstack([looks.colour, [m["colours"][0] for m in materials]]),
            specular=np.append(looks.specular, [m["specular"] for m in materials]),
            shininess=np.append(looks.shininess, [m["shininess"] for m in materials]),
        ),
    )
