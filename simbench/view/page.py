"""The page of a recording: one file that asks nothing of a network."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from simbench.formats.store import Part, Stored
from simbench.report import palette
from simbench.view import caps
from simbench.view.hidden import hidden_block
from simbench.view.seen import Shown, seen_block, shown_of

SCRIPTS = ("js_read.js", "js_birds_eye.js", "js_strip.js", "js_page.js")
LOOK: Mapping[str, Any] = {
    "dark": palette.INK, "plain": palette.PLAIN, "grid": "#2C333C", "soft": "#A3AEBC", "ground": "#77818E",
    "beam": palette.OUTSIDE, "shift": palette.SHIFT,
    # On the dark ground of the views: those of the palette that are light enough.
    "objects": [
        palette.OUTSIDE, palette.OBJECTS[4], palette.RIGHT, palette.AOI, palette.WRONG, palette.SHIFT,
    ],
    # Matplotlib's cividis from 0.36 to 1: the same order to every kind of eye.
    "ramp": ["#5e626e", "#727274", "#868379", "#9d9576", "#b5a86f", "#cebc63", "#e7d150", "#fee838"],
    "height_m": 4, "eye_px": 520,
}  # fmt: skip


def page_of(stored: Stored) -> str:
    """The page as HTML: same recording, same bytes. BadInput: it holds no sweep, or nobody says where its
    LiDAR is."""
    shown = shown_of(stored.recording)
    script = _script()
    made = Environment(
        loader=PackageLoader("simbench.view", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    source = stored.manifest.source
    return made.get_template("page.html.j2").render(
        title=f"{source.scenario}, {source.system}, seed {source.seed}",
        missing=stored.missing,
        faults="faults: " + (", ".join(source.faults) or "none"),
        counts=f"{len(stored.recording.messages)} messages",
        about=_about(stored),
        thinned=_thinned(shown),
        pictured=any((of >= 0).any() for of in shown.images),
        image_width=caps.IMAGE_WIDTH_PX,
        every_picture=shown.every_picture,
        most_images=caps.MOST_IMAGES,
        n_colours=len(LOOK["objects"]),
        look=_json(LOOK),
        seen=_json(seen_block(stored.recording, shown)),
        hidden=_json(hidden_block(stored.recording, shown)),
        script=Markup(script),  # ours
        script_hash="sha256-" + base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode(),
        c=palette,
    )


def _script() -> str:
    parts = [files("simbench.view").joinpath(name).read_text(encoding="utf-8") for name in SCRIPTS]
    return '"use strict";\n(() => {\n' + "\n".join(parts) + "})();\n"


def _json(content: Mapping[str, Any]) -> Markup:
    """JSON that ends no script and begins no comment in HTML."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _about(stored: Stored) -> list[tuple[str, str]]:
    manifest, recording = stored.manifest, stored.recording
    source = manifest.source
    return [
        ("status", stored.status + (": " + "; ".join(stored.missing) if stored.missing else "")),
        ("scenario", source.scenario), ("system", source.system), ("seed", str(source.seed)),
        ("faults", ", ".join(source.faults) or "none"), ("changes", ", ".join(source.changes) or "none"),
        ("images", source.images), ("simbench", manifest.simbench),
        ("messages", _part(manifest.messages, len(recording.messages))),
        ("truth", _part(manifest.truth, len(recording.truth.scans) + len(recording.truth.images))),
    ]  # fmt: skip


def _part(part: Part | None, read: int) -> str:
    if part is None:
        return f"{read} read; no count or hash was written"
    return f"{part.count} written, SHA-256 {part.sha256[:12]}…"


def _thinned(shown: Shown) -> str:
    sweeps = "all sweeps" if shown.every_sweep == 1 else f"one in {shown.every_sweep} sweeps"
    most = max(sweep.every for sweep in shown.sweeps)
    points = "all points" if most == 1 else f"every k-th point of a sweep, k = {most} at most"
    return f"{sweeps}; {points} (at most {caps.MOST_POINTS} a sweep), to the centimetre"
