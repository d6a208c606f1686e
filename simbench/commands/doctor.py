"""`simbench doctor`, `simbench learn`."""

from __future__ import annotations

from pathlib import Path

import click

from simbench.commands.options import seeds_of


@click.command()
@click.argument("names", nargs=-1, metavar="[FAULT...]")
@click.option("--faults", is_flag=True, help="Prove the faults of the catalogue instead, or those named.")
@click.option("--quick", is_flag=True, help="10 honest draws a fault instead of 5,000.")
@click.option("--draws", type=click.IntRange(2), default=None, help="So many honest draws.")
@click.option("--jobs", type=click.IntRange(1, 256), default=None, help="Processes (default: cores).")
def doctor(names: tuple[str, ...], faults: bool, quick: bool, draws: int | None, jobs: int | None) -> None:
    """Say what this machine offers and what is missing.

    With --faults: make every fault do what it should not (nothing, half, double, the wrong sign, sensor or
    unit, twice) and see whether the receipts notice; draw it honestly many times and see that they do not;
    raise its severity and see that its effect grows.

    Example: simbench doctor --faults --quick timing.clock_offset_ms
    """
    if not faults:
        if names or quick or draws is not None:
            raise click.UsageError("fault names, --quick and --draws go with --faults")
        from simbench import doctor as rooms

        raise SystemExit(rooms.main())
    from simbench.proving.command import FULL, QUICK, prove_faults

    raise SystemExit(prove_faults(names, draws or (QUICK if quick else FULL), jobs))


@click.command()
@click.option("--seeds", default="100000-100003", callback=seeds_of, help="From 100000 on.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), required=True, help="The JSON file.")
def learn(seeds: tuple[int, ...], out: Path) -> None:
    """Learn the shape filter's benchmark shapes from the bench (fusion/shapes.json).

    Example: simbench learn --seeds 100000-100003 --out fusion/shapes.json
    """
    from scenarios.errors import BadInput
    from simbench.files import prepare_folder, write_text
    from simbench.learn import FIRST_SEED
    from simbench.learn import learn as learn_shapes

    if min(seeds) < FIRST_SEED:
        raise BadInput(
            f"seed {min(seeds)} is for evaluation", field="--seeds", allowed=f"from {FIRST_SEED} on"
        )
    prepare_folder(out.parent)
    write_text(out, learn_shapes(seeds))
    click.echo(f"wrote {out}")
