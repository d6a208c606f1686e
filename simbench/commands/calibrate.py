"""`simbench calibrate`."""

from __future__ import annotations

from pathlib import Path

import click

from simbench.commands.options import size_of


@click.command()
@click.argument("rig")
@click.option("--cameras", default="", metavar="NAME,...", help="Only these cameras. Default: all.")
@click.option("--poses", type=int, default=20, show_default=True, help="Poses of the board a camera.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of all that is drawn.")
@click.option(
    "--click-noise-px", type=float, default=1.0, show_default=True, help="Of a click in the picture, 1 SD."
)
@click.option(
    "--corner-noise-mm", type=float, default=10.0, show_default=True,
    help="Of a corner picked among LiDAR points, 1 SD, every axis.",
)  # fmt: skip
@click.option(
    "--volume", default="3,6,0.6", show_default=True, metavar="NEAR,FAR,RADIUS",
    help="Where boards are held: metres from the camera, share of the half diagonal.",
)  # fmt: skip
@click.option("--fit-distortion", is_flag=True, help="Fit the lens's distortion (the paper does not).")
@click.option("--size", callback=size_of, default=None, help="Image size in pixels, e.g. 960x600.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="A YAML file for what is found.")
def calibrate(
    rig: str, cameras: str, poses: int, seed: int, click_noise_px: float, corner_noise_mm: float,
    volume: str, fit_distortion: bool, size: tuple[int, int] | None, out: Path | None,
) -> None:  # fmt: skip
    """Calibrate a rig as the paper does, with a checkerboard that the bench shows to camera and LiDAR.

    Prints, against the truth: reprojection error, extrinsic error, and the TPR of a static board by pair (the
    paper's Table I) and inside and outside the calibrated zone.

    Example: simbench calibrate car-six-cameras --cameras cam-front --out out/calibration.yaml
    """
    from simbench.calibration.file import write_calibration
    from simbench.calibration.study import PairStudy, Settings, calibrate_rig
    from simbench.calibration.text import lines
    from simbench.calibration.volume import parse_volume
    from simbench.files import prepare_folder

    if out is not None:
        prepare_folder(out.parent)
    settings = Settings(
        rig=rig, cameras=tuple(dict.fromkeys(filter(None, cameras.split(",")))), poses=poses, seed=seed,
        click_noise_px=click_noise_px, corner_noise_m=1e-3 * corner_noise_mm, volume=parse_volume(volume),
        fit_distortion=fit_distortion, size_px=size,
    )  # fmt: skip

    def done(pair: PairStudy) -> None:
        click.echo(f"{pair.camera}: done", err=True)

    study = calibrate_rig(settings, done)
    for line in lines(study):
        click.echo(line)
    if out is not None:
        write_calibration(study, out)
        click.echo(f"\nwrote {out}")
