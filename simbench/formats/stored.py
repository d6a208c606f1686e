"""Jobs on the bench's own recordings: `rec:FOLDER` is played as it was made."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path, PurePath

from fusion.messages import LidarScan
from scenarios.errors import BadInput, Where
from scenarios.fault_set import FaultSet, fault_set, parse_specs
from simbench.case import Job
from simbench.formats.recorded import Recorded
from simbench.formats.scene import RecordedObject, RecordedScene
from simbench.formats.store import MANIFEST, Manifest, read_manifest, read_recording
from simbench.formats.targets import STORED
from simbench.recording import Recording


def stored_target(word: str) -> str | None:
    """`rec:FOLDER` of a word of the command line that names a recording's folder; None: it does not."""
    return STORED + word if word and (Path(word) / MANIFEST).is_file() else None


def plan_stored(job: Job, numbers: Sequence[int] | None) -> Job:
    """A job on `rec:FOLDER` with the recording's own rig and seed. BadInput: no recording lies there, or the
    job asks for what was decided when it was made."""
    folder = folder_of(job)
    asked = [
        ("--faults", job.faults), ("--boxes", job.boxes), ("--frames", job.frames), ("--size", job.size_px),
        ("--seeds", numbers),
    ]  # fmt: skip
    for option, given in asked:
        if given:
            raise BadInput(f"{option} is not for a recording: it was made as it is", file=str(folder))
    source = read_manifest(folder).source
    if job.system not in (source.system, "both"):
        raise BadInput(f"was recorded on the rig '{source.system}', not '{job.system}'", file=str(folder))
    images = "none" if job.images == "none" else source.images  # pictures are shown where there are some
    return replace(job, system=source.system, seed=source.seed, images=images)


def play_stored(job: Job, *, images: bool) -> Recorded:
    """The recording of a job, its pictures too where a pipeline wants them. BadInput: none is there, or it
    is damaged."""
    folder = folder_of(job)
    stored = read_recording(folder, images=images)
    recording = stored.recording
    injected = stored.manifest.injected
    return Recorded(
        scene=scene_of(stored.manifest, recording), faults=faults_of(stored.manifest, folder),
        recording=recording, receipts=injected.receipts, shake=injected.shake,
        missing=stored.missing,
    )  # fmt: skip


def folder_of(job: Job) -> Path:
    """Of a job on `rec:FOLDER`."""
    return Path(job.scenario.removeprefix(STORED))


def faults_of(manifest: Manifest, folder: Path) -> FaultSet:
    """What was injected. BadInput: this version knows no such fault."""
    where = Where(file=str(folder / MANIFEST))
    return fault_set(parse_specs(dict(manifest.injected.specs), where), manifest.injected.label)


def scene_of(manifest: Manifest, recording: Recording) -> RecordedScene:
    """What stands in place of a scenario."""
    source, truth, part = manifest.source, recording.truth, manifest.messages
    scans = [m for m in recording.messages if isinstance(m, LidarScan)]
    return RecordedScene(
        name=_name(source.scenario),
        description=f"a recording of {source.scenario}, {source.system}, seed {source.seed}",
        rig=source.system,
        number=source.seed,
        frames=(0, max(len(scans) - 1, 0)),
        sweeps=len(scans),
        duration_s=_duration_s(recording),
        boxes="model",
        objects=tuple(
            RecordedObject(name=o.name, category=o.category, size_m=o.size_m, occlusion_known=True)
            for o in truth.objects
            if o.object_id in (truth.targets or (truth.target_id,))
        ),
        sha256="" if part is None else part.sha256,
    )


def _name(scenario: str) -> str:
    """A scenario's name, or what is nearest to one of a file's."""
    word = re.sub("[^a-z0-9_-]", "-", PurePath(scenario).stem.lower())[:60]
    return word if word[:1].isalpha() else f"of-{word}"


def _duration_s(recording: Recording) -> float:
    times = [m.arrival_ns for m in recording.messages]
    return 1e-9 * (max(times) - min(times)) if times else 0.0
