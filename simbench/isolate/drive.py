"""`simbench.drive.drive` with the pipeline in a process of its own: the same answers, its own clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fusion.messages import Calibration, CategorySize, LidarScan, Measurement
from scenarios.errors import BadInput
from simbench.drive import Driven
from simbench.isolate.limits import Failed, Limits
from simbench.isolate.reference import command_of
from simbench.isolate.session import Session


def drive_isolated(
    name: str,
    calibration: Calibration,
    categories: Mapping[str, CategorySize],
    messages: Sequence[Measurement],
    limits: Limits,
) -> Driven:
    """Run the pipeline of that name over messages in order of arrival, in a process that ends with the run.

    Raises `Failed` or `TimedOut` with one sentence, whatever the pipeline does.
    """
    outputs, spent = [], list[float]()
    try:
        session = Session(command_of(name), limits)
    except BadInput as error:
        raise Failed(str(error).rstrip(".")) from error
    with session:
        session.reset(calibration, categories)
        for message in messages:
            output = session.update(message)
            took_ms = session.took_ns * 1e-6
            if isinstance(message, LidarScan):
                spent.append(took_ms)
            elif spent:
                spent[-1] += took_ms  # the work that a scan causes may come with a later message
            if output is not None:
                outputs.append(output)
        trajectories = session.trajectories()
        session.finish()
        return Driven(
            outputs=tuple(outputs),
            trajectories=trajectories,
            scan_ms=tuple(spent),
            step_ns=session.timings_ns(),
        )
