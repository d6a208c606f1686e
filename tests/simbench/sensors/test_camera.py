"""Whole images by rays: against OpenGL, against the laws of a rolling shutter, and against themselves."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from fusion.camera import PinholeCamera
from fusion.geometry import Transform
from scenarios.errors import BadInput
from scenarios.scenario import CameraSensor, ImageNoise
from simbench.axes import R_BODY_OPTICAL, pinhole
from simbench.motion import Motion, at
from simbench.sensors import camera as by_rays
from simbench.sensors import gl, rays
from simbench.sensors.clock import camera_timing
from simbench.sensors.develop import develop
from simbench.sensors.lens import pixel_directions
from simbench.sensors.pictures import by_gl
from simbench.sensors.pictures import by_rays as pictures_by_rays
from simbench.sensors.render import Renderer
from simbench.sensors.rows import exposure_at, line_delay_ns, row_times_ns
from simbench.sensors.shade import Palette
from tests.simbench.scenes import (
    Shape,
    SystemName,
    a_camera,
    scripted_motion,
    shaken_motion,
    staged,
    straight,
    toy_world,
)

T_NS = 2_000_000_000


def take(
    motion: Motion,
    name: str,
    sensor: CameraSensor,
    delay_ns: float = 0.0,
    seed: int | None = None,
    t_ns: int = T_NS,
) -> by_rays.Frame:
    rng = None if seed is None else np.random.default_rng(seed)
    return by_rays.take(motion, name, sensor, pinhole(sensor), t_ns, delay_ns, rng)


def watched(*shapes: Shape, speeds_mps: tuple[float, ...] = (0.0,)) -> Motion:
    """A camera 1 m above the origin that looks along x. Mover i drives along y at speeds_mps[i], to the left
    where that is positive; at T_NS it is 10 m ahead."""
    ego = Shape(kind=rays.SPHERE, size_m=(0.01, 0.0, 0.0), xyz_m=(0.0, 0.0, -50.0), mover=0)
    tracks = [straight((0.0, 0.0), 0.0, 0.0)]
    for v in speeds_mps:
        tracks.append(straight((10.0, -v * 1e-9 * T_NS), 90.0 if v >= 0.0 else -90.0, abs(v)))
    pose = Transform(rotation=R_BODY_OPTICAL, translation_m=np.array([0.0, 0.0, 1.0]))
    return Motion(
        world=toy_world([ego, *shapes], tracks), ego_actor=0, T_ego_root=Transform.identity(),
        T_ego_sensor={"cam": pose},
    )  # fmt: skip


PLATE = Shape(kind=rays.BOX, size_m=(0.5, 0.01, 1.5), xyz_m=(0.0, 0.0, 1.0), mover=1)
WALL = Shape(kind=rays.BOX, size_m=(0.1, 30.0, 30.0), xyz_m=(25.0, 0.0, 0.0))
GROUND = Shape(kind=rays.PLANE, size_m=(0.0, 0.0, 1.0))


# -- a rolling shutter ------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed_mps", [8.0, -5.0])
@pytest.mark.parametrize("delay_ns", [20_000.0, 90_000.0])
def test_a_crossing_target_is_sheared_by_its_speed_times_the_line_delay_per_row(
    speed_mps: float, delay_ns: float
) -> None:
    """The plate is drawn by rows, each by (r - middle) * delay * v / z pixels to the left of where it stands
    (it drives to the left); its middle row as by a global shutter."""
    sensor = a_camera(width_px=320, height_px=240, fov_deg=40.0)
    lens = pinhole(sensor)
    motion = watched(PLATE, speeds_mps=(speed_mps,))
    rolling = take(motion, "cam", sensor, delay_ns).object_id == 1
    columns = np.arange(320) + 0.5
    rows = np.flatnonzero(rolling.sum(axis=1) > 4)
    middle = np.array([columns[rolling[r]].mean() for r in rows])
    assert len(rows) > 80
    per_row_px = -speed_mps * delay_ns * 1e-9 * lens.fx_px / 9.99  # its near side
    slope, at_centre = np.polyfit(rows - 119.5, middle, 1)
    assert slope == pytest.approx(per_row_px, abs=0.01)
    assert at_centre == pytest.approx(160.0, abs=0.3)


def test_the_first_row_is_exposed_first_and_the_middle_of_all_is_mid_exposure() -> None:
    t_ns = row_times_ns(T_NS, 30_000.0, 11)
    assert t_ns[0] == T_NS - 150_000
    assert t_ns[5] == T_NS
    assert (np.diff(t_ns) == 30_000).all()
    assert (row_times_ns(T_NS, 0.0, 11) == T_NS).all()


def test_the_line_delay_is_the_clocks() -> None:
    sensor = a_camera(shutter="rolling", readout_ms=20.0)
    timing = camera_timing(sensor, 0, 100_000_000, 2, np.random.default_rng(0))
    assert line_delay_ns(sensor) == timing.line_delay_ns == 20e6 / 59
    np.testing.assert_allclose(
        row_times_ns(int(timing.mid_ns[1]), line_delay_ns(sensor), 60), timing.row_mid_ns(1, 60), atol=0.5
    )


def test_a_vanishing_line_delay_is_a_global_shutter() -> None:
    """Exactly at 0; and at 1 ns a row, which takes the rows' own path, all but the same."""
    of = staged("overtake-approach", "car", 1)
    motion, sensor = shaken_motion(of), a_camera(width_px=240, height_px=150)
    frozen, same, rolling = (take(motion, "cam-front", sensor, delay) for delay in (0.0, 0.0, 1.0))
    assert np.array_equal(frozen.rgb, same.rgb) and np.array_equal(frozen.depth_m, same.depth_m)
    assert (frozen.object_id == rolling.object_id).mean() > 0.9995
    near = (rolling.depth_m < 50.0) & (frozen.depth_m < 50.0)
    assert np.quantile(np.abs(frozen.depth_m[near] - rolling.depth_m[near]), 0.99) < 1e-4


def test_each_row_of_a_rolling_image_is_that_row_of_a_global_image_at_its_time() -> None:
    of = staged("overtake-recede", "wearable", 3)
    motion, sensor = shaken_motion(of), a_camera(width_px=240, height_px=150, fov_deg=78.0)
    rolling = take(motion, "cam-centre", sensor, 150_000.0)
    t_ns = row_times_ns(T_NS, 150_000.0, 150)
    for row in (0, 40, 75, 110, 149):
        frozen = take(motion, "cam-centre", sensor, t_ns=int(t_ns[row]))
        assert (rolling.object_id[row] == frozen.object_id[row]).mean() >= 0.99
        near = (frozen.depth_m[row] < 60.0) & (rolling.object_id[row] == frozen.object_id[row])
        if near.any():
            error = np.abs(rolling.depth_m[row][near] - frozen.depth_m[row][near])
            assert np.quantile(error, 0.95) < 1e-3


# -- motion blur ------------------------------------------------------------------------------------------


def test_a_still_scene_is_not_blurred() -> None:
    motion = watched(PLATE, WALL, GROUND)
    for samples in (3, 5, 7):
        blurred = take(motion, "cam", a_camera(motion_blur_samples=samples, exposure_ms=50.0))
        sharp = take(motion, "cam", a_camera())
        assert np.array_equal(blurred.rgb, sharp.rgb)
        assert np.array_equal(blurred.depth_m, sharp.depth_m)


def test_blur_is_the_mean_of_light_over_instants_spread_over_the_exposure() -> None:
    motion = watched(PLATE, WALL, GROUND, speeds_mps=(12.0,))
    sensor = a_camera(exposure_ms=30.0, motion_blur_samples=3)
    lens, palette = pinhole(sensor), Palette(looks=motion.world.looks)
    total = np.zeros((60, 96, 3))
    for offset_ns in (-10_000_000, 0, 10_000_000):
        exposure = exposure_at(motion, "cam", row_times_ns(T_NS + offset_ns, 0.0, 60))
        total += by_rays.light_in(lens, exposure, palette, by_rays.look(lens, exposure))
    expected = develop((total / 3.0).astype(np.float32), sensor, None)
    found = take(motion, "cam", sensor)
    assert np.array_equal(found.rgb, expected)
    sharp = take(motion, "cam", a_camera())
    assert not np.array_equal(found.rgb, sharp.rgb)
    assert np.array_equal(found.object_id, sharp.object_id)


# -- the same bytes ---------------------------------------------------------------------------------------


def test_images_are_the_same_bytes_whatever_the_threads() -> None:
    of = staged("overtake-approach", "car", 2)
    motion = shaken_motion(of)
    noise = ImageNoise(full_well_e=3000.0, read_noise_e=4.0)
    sensor = a_camera(width_px=200, height_px=120, noise=noise, jpeg_quality=90, motion_blur_samples=3)
    names = list(of.rig.cameras)

    def one(number: int) -> by_rays.Frame:
        return take(motion, names[number], sensor, 20_000.0, seed=number)

    alone = [one(i) for i in range(len(names))]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(one, reversed(range(len(names)))))[::-1]
    for a, b in zip(alone, together, strict=True):
        assert np.array_equal(a.rgb, b.rgb)
        assert np.array_equal(a.object_id, b.object_id)
        assert np.array_equal(a.depth_m, b.depth_m)


def test_another_seed_moves_the_noise_and_nothing_else() -> None:
    motion = watched(PLATE, WALL, GROUND)
    sensor = a_camera(noise=ImageNoise(full_well_e=3000.0, read_noise_e=4.0))
    first, other = take(motion, "cam", sensor, seed=1), take(motion, "cam", sensor, seed=2)
    assert not np.array_equal(first.rgb, other.rgb)
    assert np.array_equal(first.object_id, other.object_id)
    assert np.abs(first.rgb.astype(int) - other.rgb).mean() < 8.0


def test_a_runs_images_have_noise_of_their_own_each_and_come_back() -> None:
    of = staged("overtake-approach", "car", 2)
    noise = ImageNoise(full_well_e=3000.0, read_noise_e=4.0)
    small = {name: a_camera(noise=noise) for name in of.rig.cameras}
    rig = replace(of.rig, cameras=small, pinholes={name: pinhole(c) for name, c in small.items()})
    motion, picture = scripted_motion(of), pictures_by_rays(rig, 7)
    first = picture(motion, "cam-front", 0, T_NS)
    assert np.array_equal(first, pictures_by_rays(rig, 7)(motion, "cam-front", 0, T_NS))
    assert not np.array_equal(first, picture(motion, "cam-front", 1, T_NS))
    assert not np.array_equal(first, pictures_by_rays(rig, 8)(motion, "cam-front", 0, T_NS))


# -- what is seen -----------------------------------------------------------------------------------------


def test_a_ball_is_lit_on_the_side_of_the_sun_and_throws_its_shadow_away_from_it() -> None:
    """The sun stands behind, to the left and above of a camera that looks along x."""
    ball = Shape(kind=rays.SPHERE, size_m=(1.0, 0.0, 0.0), xyz_m=(0.0, 0.0, 1.5), mover=1)
    motion = watched(ball, GROUND)
    frame = take(motion, "cam", a_camera(width_px=240, height_px=180))
    brightness = frame.rgb.astype(float).sum(axis=2)
    on_ball = frame.object_id == 1
    rows, columns = np.nonzero(on_ball)
    brightest = brightness[on_ball].argmax()
    assert columns[brightest] < columns.mean() and rows[brightest] < rows.mean()
    # The ground just right of the ball lies in its shadow, that to the left in the sun.
    bare = take(watched(GROUND), "cam", a_camera(width_px=240, height_px=180)).rgb.astype(float).sum(axis=2)
    darker = (bare - brightness > 60.0) & ~on_ball
    assert darker.sum() > 50
    assert np.nonzero(darker)[1].mean() > columns.mean()


def test_depth_is_along_the_axis_and_the_sky_is_far() -> None:
    frame = take(watched(WALL), "cam", a_camera())
    np.testing.assert_allclose(frame.depth_m, 24.9, atol=1e-5)
    empty = take(watched(PLATE), "cam", a_camera())
    assert np.isinf(empty.depth_m[empty.object_id == -1]).all()
    assert set(np.unique(empty.object_id)) == {-1, 1}


def test_the_sky_is_brighter_at_the_horizon_and_nothing_is_without_colour() -> None:
    frame = take(watched(GROUND), "cam", a_camera(width_px=100, height_px=100, fov_deg=90.0))
    assert frame.rgb[48].mean() > frame.rgb[0].mean() + 20.0
    assert frame.rgb.min() > 0


def test_a_distorted_lens_bends_the_picture_as_projection_says() -> None:
    sensor = a_camera(width_px=320, height_px=240, distortion=(-0.25, 0.05, 0.002, -0.001, 0.0))
    small = Shape(kind=rays.SPHERE, size_m=(0.15, 0.0, 0.0), xyz_m=(0.0, 4.0, 3.0), mover=1)
    motion = watched(small)
    rows, columns = np.nonzero(take(motion, "cam", sensor).object_id == 1)
    T_camera_world = at(motion.sensor("cam", np.array([T_NS]))).inverse()
    (uv,) = pinhole(sensor).project(
        T_camera_world.apply(np.array([[10.0, 0.0, 0.0]]) + np.array([-4.0, 0.0, 3.0]))
    )
    assert np.hypot(columns.mean() + 0.5 - uv[0], rows.mean() + 0.5 - uv[1]) < 0.4


# -- against OpenGL ---------------------------------------------------------------------------------------

CASES: tuple[tuple[str, SystemName, int, float], ...] = (
    ("overtake-approach", "car", 1, 3.9),
    ("overtake-recede", "wearable", 4, 0.9),
)


@pytest.mark.parametrize(("scenario", "system", "seed", "t_s"), CASES)
def test_ids_depth_and_looks_are_those_of_opengl(
    scenario: str, system: SystemName, seed: int, t_s: float
) -> None:
    """Ids on 99.5 % of the pixels; depth to 3 cm for 99 % of what lies within 60 m, but for grass: a slab of
    1 mm that rays do not see. Looks: OpenGL lights by other rules, so they are alike, not equal."""
    of = staged(scenario, system, seed)
    motion, t_ns = shaken_motion(of), round(t_s * 1e9)
    try:
        renderer = Renderer(of.world, fine=True)
    except gl.RenderingUnavailable as reason:
        pytest.skip(str(reason))
    half_road_m = 0.5 * of.scenario.road.width_m
    with renderer:
        for name in list(of.rig.cameras)[:3]:
            lens: PinholeCamera = of.rig.pinholes[name]
            sensor = of.rig.cameras[name].model_copy(
                update={"monochrome": False, "noise": None, "jpeg_quality": None}
            )
            pose = at(motion.sensor(name, np.array([t_ns])))
            ids, depth_m = renderer.ids_and_depth(motion, t_ns, pose, lens)
            picture = renderer.rgb(motion, t_ns, pose, lens).astype(float)
            frame = by_rays.take(motion, name, sensor, lens, t_ns, 0.0, None)
            assert (frame.object_id == ids).mean() >= 0.995
            direction = pixel_directions(lens)
            with np.errstate(invalid="ignore"):
                along_y = (direction @ pose.rotation[1]) * (frame.depth_m / direction[..., 2])
            on_grass = (ids == -1) & (np.abs(along_y + pose.translation_m[1]) > half_road_m)
            same = (frame.object_id == ids) & (frame.depth_m < 60.0) & np.isfinite(depth_m) & ~on_grass
            assert np.quantile(np.abs(frame.depth_m[same] - depth_m[same]), 0.99) <= 0.03
            ours = frame.rgb.astype(float)
            assert np.abs(ours - picture).mean() < 30.0
            assert np.corrcoef(ours.mean(axis=2).ravel(), picture.mean(axis=2).ravel())[0, 1] > 0.9


def test_opengl_refuses_a_distorted_lens() -> None:
    of = staged("overtake-approach", "car", 1)
    bent = {n: replace(c, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0)) for n, c in of.rig.pinholes.items()}
    try:
        renderer = Renderer(of.world)
    except gl.RenderingUnavailable as reason:
        pytest.skip(str(reason))
    with renderer, pytest.raises(BadInput, match="raycast"):
        by_gl(replace(of.rig, pinholes=bent), renderer)


def test_opengls_picture_of_a_monochrome_camera_is_grey() -> None:
    of = staged("overtake-approach", "car", 1)
    assert of.rig.cameras["cam-front"].monochrome
    try:
        renderer = Renderer(of.world)
    except gl.RenderingUnavailable as reason:
        pytest.skip(str(reason))
    with renderer:
        picture = by_gl(of.rig, renderer)(scripted_motion(of), "cam-front", 0, T_NS)
    assert (picture == picture[..., :1]).all() and picture.std() > 5.0
