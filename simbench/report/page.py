"""One self-contained page of a run: a sentence, one instant in three crops, figures and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from fusion.camera import PinholeCamera
from fusion.messages import BoxPx
from scenarios.errors import BadInput
from simbench.case import Images, Job, JobResult
from simbench.exhibit import PairView
from simbench.files import write_text
from simbench.formats.scene import RecordedScene
from simbench.formats.targets import is_recorded, is_stored
from simbench.report import figures, palette, tables
from simbench.report.agreement import (
    AgreementLine,
    agreement_lines,
    drawn_pipelines,
    is_shown,
    scored_curves,
)
from simbench.report.choose import (
    Group,
    Instant,
    case_of,
    groups_of,
    median_and_worst,
    pairs_of,
    views_of,
)
from simbench.report.distance_figure import distance_figure
from simbench.report.objects import MOST_LINES, object_tables
from simbench.report.overlay import Marks, common_field, crop_svg, cut, jpeg_uri, marks_of
from simbench.report.pictures import Replayed, explain_view, replay_of, take_pictures
from simbench.report.video import find_video, poster_uri
from simbench.report.words import (
    counted,
    fault_words,
    joined,
    metres,
    percent,
    pipeline_words,
    points,
    runs_words,
    sentence,
    told_words,
)
from simbench.score.statistics import MIN_RUNS

SHARPER = 2  # pictures are drawn with twice the camera's pixels, for print
CROP_PX = 800  # width of a crop's picture

NOT_SHOWN = (
    "Boxes come from a simulated detector (misses in bursts, false boxes, edge errors where injected), not "
    "from a network; with --boxes labels they are exact.",
    "Bodies are rigid primitives with one reflectivity a material; glass is opaque; no loose clothes.",
    "No rain, fog, dust, sun glare, mirrors, retroreflectors, multi-path or cross-talk between LiDARs; the "
    "visible ground is flat.",
    "Vibration is scripted noise of the stated level; motion.road integrates a vehicle, on a drawn road.",
    "Cameras have hard shadows, no vignetting, lens flare, Bayer pattern or automatic exposure.",
    "The paper published no data: its values stand beside ours for orientation. That its scenario 1 is the "
    "approach and its scenario 2 the receding half is assumed.",
    "The paper's TPR asks for distance only, and a thin slice of an object scores above all of its points: "
    "the oracle is a ceiling for recall, not for TPR.",
)

RECORDED_NOT_SHOWN = (
    "Truth is by hand: labelled boxes have errors of a decimetre or two, a point inside a box counts as the "
    "object's (some of the ground below it too), and what is not labelled is no object.",
    "Boxes are the labels' own unless the detector model was asked for: no network was run.",
    "Visible shares come from the labels' levels of occlusion, and no firing time of a point was stored: all "
    "points of a sweep count as fired at its stamp.",
    "Frames of the object layout are independent: no track, no trajectory, nothing smoothed.",
)
RECORDED_STILLS: Mapping[Images, str] = {
    "none": "",
    "raycast": "Pictures are the recorded ones.",
    "gl": "Pictures are the recorded ones.",
}
STILLS: Mapping[Images, str] = {
    "none": "",
    "raycast": "Pictures are finer than the camera's, in colour, without noise, blur, JPEG.",
    "gl": "Pictures are finer than the camera's, in colour, all rows at one instant.",
}


@dataclass(frozen=True, kw_only=True)
class Crop:
    title: str
    note: str
    svg: Markup


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One instant as up to three crops of the same field."""

    caption: str
    crops: tuple[Crop, ...]


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Trajectory over budget of one pipeline."""

    title: str
    note: str
    birds_eye: Markup | None
    budget: Markup | None


@dataclass(frozen=True, kw_only=True)
class Joined:
    """The distance curves of one pipeline in one run."""

    title: str
    note: str
    svg: Markup


@dataclass(frozen=True, kw_only=True)
class Video:
    name: str
    poster: str
    words: str


@dataclass(frozen=True, kw_only=True)
class Section:
    """What the page shows of one group."""

    title: str
    anchor: str
    group: Group
    faults: str
    shake: str
    stamps: str
    told: str
    median: Shot | None
    worst: Shot | None
    panels: tuple[Panel, ...]
    over_frames: Markup | None
    seed: int | None
    modes: Markup | None
    shapes: Markup | None
    explained: str
    distances: tuple[Joined, ...]
    agreement: tuple[AgreementLine, ...]
    columns: tuple[tables.Column, ...]
    heads: tuple[tuple[str, int], ...]
    lines: tuple[tables.Line, ...]
    videos: tuple[Video, ...]


def write_report(
    results: Sequence[JobResult],
    out: Path,
    *,
    command: str,
    images: Images,
    environment: Mapping[str, object],
) -> Path:
    """Write `out/report.html` and return its path. `images`: 'none' draws no pictures. Videos that lie in
    `out` are linked. ValueError without results; gl.RenderingUnavailable where nothing draws the pictures."""
    if not results:
        raise ValueError("a report needs at least one result")
    groups = groups_of(results)
    recorded = all(is_recorded(r.job.scenario) for r in results)
    labelled = recorded and not any(is_stored(r.job.scenario) for r in results)
    sections = tuple(
        section_of(group, number, images=images, out=out) for number, group in enumerate(groups, start=1)
    )
    page = _template().render(
        title=_title(groups),
        sentence=sentence(groups),
        badges=tables.badges(results, groups),
        runs=runs_words(groups),
        hero=sections[0],
        sections=sections,
        dots=figures.paired_dots(groups) if any(g.has_target() for g in groups) else None,
        definitions=tables.DEFINITIONS,
        names=tables.name_lines(groups),
        receipts=tables.receipt_lines(results),
        failed=[(r, c) for r in results for c in r.cases if c.status != "ok"],
        not_shown=_not_shown(groups, images, labelled),
        objects=object_tables(results),
        most_lines=MOST_LINES,
        environment=_flat(environment),
        seeds=", ".join(str(s) for s in sorted({r.job.seed for r in results})),
        command=command,
        images=images,
        stills=RECORDED_STILLS[images] if recorded else STILLS[images],
        metres=metres,
        c=palette,
    )
    path = out / "report.html"
    write_text(path, page)
    return path


def _title(groups: Sequence[Group]) -> str:
    scenarios = list(dict.fromkeys(g.scenario for g in groups))
    systems = list(dict.fromkeys(g.system for g in groups))
    shown = scenarios if len(scenarios) <= 2 else [scenarios[0], f"{len(scenarios) - 1} more"]
    return f"{joined(shown)}, {joined(systems)}"


def _template() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("simbench.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return made.get_template("page.html.j2")


def _not_shown(groups: Sequence[Group], images: Images, labelled: bool) -> tuple[str, ...]:
    few = min(len(group.runs) for group in groups) < MIN_RUNS
    first = (
        (f"{runs_words(groups)}. No intervals, no p-values: other seeds may look different.",) if few else ()
    )
    scenarios = counted(len({g.scenario for g in groups}), "scenario")
    last = (f"{scenarios} of the catalogue: the numbers are about these, not about traffic.",)
    if labelled:
        last = ("The numbers are about these recordings, not about traffic.",)
    plain = ("No pictures were rendered: points stand on a plain ground.",) if images == "none" else ()
    return (*first, *(RECORDED_NOT_SHOWN if labelled else NOT_SHOWN), *last, *plain)


def _flat(environment: Mapping[str, object], above: str = "") -> list[tuple[str, str]]:
    found = []
    for key, value in environment.items():
        if isinstance(value, Mapping):
            found += _flat(value, f"{above}{key} ")
        else:
            found.append((f"{above}{key}", str(value)))
    return found


# -- one group ------------------------------------------------------------------------------------------


def section_of(group: Group, number: int, *, images: Images, out: Path) -> Section:
    chosen = median_and_worst(group)
    sample = group.results(group.main_side)[0][1]
    median = worst = modes = shapes = over_frames = None
    explained, stamps, seed = "", "", None
    panels: tuple[Panel, ...] = ()
    shown = sample
    if chosen is not None:
        run = chosen[0].run
        seed = run.seed
        played = run.side(group.main_side)
        assert played is not None
        shown = played
        pipelines = [name for name in (group.baseline, group.method) if name is not None]
        panels = tuple(_panel(group, shown, name, pipelines) for name in pipelines)
        over_frames = figures.tpr_over_frames(group, run)
        try:
            replays = _Replays(group, chosen, images)
            stamps = replays.of(shown).stamps
            median = _shot(group, chosen[0], "median", replays)
            worst = _shot(group, chosen[1], "largest", replays)
            modes, shapes, explained = _explained(group, chosen[0], replays)
        except BadInput as why:
            explained = f"Pictures and histogram could not be made again: {why}"
    return Section(
        title=f"{group.scenario}, {group.system}" + (", calibration found" if group.told == "found" else ""),
        anchor=f"group-{number}",
        group=group,
        faults=fault_words(sample.faults) if len(sample.faults) else "no injected errors",
        shake=sample.shake,
        stamps=stamps,
        told=told_words(group.told, is_recorded(sample.job.scenario)),
        median=median,
        worst=worst,
        panels=panels,
        over_frames=over_frames,
        seed=seed,
        modes=modes,
        shapes=shapes,
        explained=explained,
        distances=_joined_curves(group, shown),
        agreement=agreement_lines(group),
        columns=tables.columns(group),
        heads=tables.heads(tables.columns(group)),
        lines=tables.lines(group),
        videos=_videos(group, out),
    )


def _joined_curves(group: Group, shown: JobResult) -> tuple[Joined, ...]:
    """The figure of distances, where several cameras see several objects."""
    drawn = [(name, scored_curves(shown, name)) for name in drawn_pipelines(group)]
    if not is_shown([shown], group.pipelines):
        return ()
    return tuple(
        Joined(
            title=f"{'Error' if group.main_side == 'faulted' else 'No error'}, {pipeline_words(name)}",
            note=f"seed {shown.job.seed}",
            svg=distance_figure(shown.distances.true, curves, f"Distances by {pipeline_words(name)}"),
        )
        for name, curves in drawn
        if curves
    )


def _panel(group: Group, shown: JobResult, pipeline: str, like: Sequence[str]) -> Panel:
    state = "Error" if group.main_side == "faulted" else "No error"
    results = group.results(group.main_side)
    return Panel(
        title=f"{state}, {pipeline_words(pipeline)}",
        note=f"seed {shown.job.seed}; budget of {counted(len(results), 'run')}",
        birds_eye=figures.birds_eye(shown, pipeline, like),
        budget=figures.budget_bars(results, pipeline, like),
    )


class _Replays:
    """Replays by job and the pictures of all chosen instants: one world and one renderer per job."""

    def __init__(self, group: Group, chosen: Sequence[Instant], images: Images) -> None:
        wanted: dict[Job, list[tuple[str, int]]] = {}
        for instant in chosen:
            for side in group.sides:
                result = instant.run.side(side)
                if result is not None:
                    view = views_of(result)[instant.key]
                    wanted.setdefault(result.job, []).append((view.camera, view.capture_ns))
        self._made = {job: replay_of(job) for job in wanted}
        self._taken = (
            {job: take_pictures(self._made[job], keys, images, SHARPER) for job, keys in wanted.items()}
            if images != "none"
            else {}
        )

    def of(self, result: JobResult) -> Replayed:
        return self._made[result.job]

    def camera(self, result: JobResult, view: PairView) -> PinholeCamera:
        return self.of(result).pinholes[view.camera]

    def picture(self, result: JobResult, view: PairView, field: BoxPx) -> str | None:
        """The field's picture as data URI; None where no pictures are wanted."""
        taken = self._taken.get(result.job)
        if taken is None:
            return None
        whole = taken[view.camera, view.capture_ns]
        return jpeg_uri(cut(whole, field, self.camera(result, view).width_px, CROP_PX))


def _shot(group: Group, instant: Instant, which: str, replays: _Replays) -> Shot:
    """No error and baseline, error and baseline, error and method: those that exist."""
    wanted = [
        (side, name)
        for side in group.sides
        for name in (group.baseline, group.method)
        if name is not None and not (side == "clean" and name == group.method and len(group.sides) == 2)
    ]
    results = {side: r for side in group.sides if (r := instant.run.side(side)) is not None}
    views = {side: views_of(r)[instant.key] for side, r in results.items()}
    cameras = {side: replays.camera(r, views[side]) for side, r in results.items()}
    marks = {(side, name): marks_of(views[side], name, cameras[side]) for side, name in wanted}
    field = common_field(list(marks.values()), cameras[group.main_side])
    pictures = {side: replays.picture(r, views[side], field) for side, r in results.items()}
    crops = tuple(
        _crop(instant, side, name, marks[side, name], field, pictures[side]) for side, name in wanted
    )
    caption = _caption(group, instant, which, results[group.main_side], views[group.main_side])
    return Shot(caption=caption, crops=crops)


def _crop(
    instant: Instant, side: str, pipeline: str, marks: Marks, field: BoxPx, picture: str | None
) -> Crop:
    result = instant.run.side(side)
    title = f"{'Error' if side == 'faulted' else 'No error'}, {pipeline_words(pipeline)}"
    pair = pairs_of(result, pipeline).get(instant.key)
    case = case_of(result, pipeline)
    if pair is not None:
        note = f"TPR {percent(pair.tpr, 0)} %, {counted(pair.n_mapped, 'point')}"
    else:
        note = "not run" if case is None else case.status.replace("_", " ")
    if marks.box is None:
        note += ", no box"
    return Crop(title=title, note=note, svg=crop_svg(marks, field, picture, f"{title}: {note}"))


def _caption(group: Group, instant: Instant, which: str, result: JobResult, view: PairView) -> str:
    where = f"{group.system}, {view.camera}, t = {1e-9 * view.scan_stamp_ns:.1f} s, seed {instant.run.seed}"
    if isinstance(result.scenario, RecordedScene):
        where = f"{result.scenario.objects[view.target].name}, {view.camera}"
        if result.scenario.sweeps > 1:
            where += f", t = {1e-9 * view.scan_stamp_ns:.1f} s"
    if instant.loss is None:
        rank = "median" if which == "median" else "lowest"
        what = f"Pair of {rank} TPR of the {pipeline_words(group.baseline)}"
    else:
        what = f"Pair of {which} loss ({points(-instant.loss)} points of TPR)"
    return f"{what} among {instant.of}: {where}."


def _explained(group: Group, instant: Instant, replays: _Replays) -> tuple[Markup | None, Markup | None, str]:
    result = instant.run.side(group.main_side)
    if group.method is None or result is None:
        return None, None, ""
    view = views_of(result)[instant.key]
    found = explain_view(replays.of(result), view, group.method)
    if found is None:
        return None, None, "No box came for this pair, or the pipeline does not tell its steps."
    pair = pairs_of(result, group.method).get(instant.key)
    surface_m = None if pair is None else pair.surface_distance_m
    words = (
        f"{counted(len(found.points), 'point')} in the AOI after ground removal, "
        f"{counted(len(found.candidates), 'candidate')}."
    )
    return figures.distance_modes(found, surface_m), figures.descriptors(found), words


def _videos(group: Group, out: Path) -> tuple[Video, ...]:
    found = []
    for run in group.runs:
        path = find_video(out, group.scenario, group.system, run.seed)
        if path is not None:
            words = f"{group.scenario}, {group.system}, seed {run.seed}"
            found.append(Video(name=path.name, poster=poster_uri(path), words=words))
    return tuple(found)
