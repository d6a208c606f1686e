"""Pictures that went through a coarse JPEG: camera.jpeg_loss. Receipts: `code_receipts.py`."""

from __future__ import annotations

from scenarios.faults.camera import JpegLoss
from simbench.faults.delivery import Delivery
from simbench.faults.fault import Acted, Site
from simbench.faults.pictures import each_picture
from simbench.faults.struck import struck
from simbench.sensors.develop import jpeg


def compress(spec: JpegLoss, delivery: Delivery, site: Site) -> Acted:
    """Every picture coded and read again."""
    realised = {name: float(spec.loss) for name in struck(spec, site.rig)}
    if spec.is_off:
        return Acted(delivery=delivery, realised=realised)
    quality = 100 - int(spec.loss)
    if not 0 <= quality <= 100:
        raise ValueError(f"there is no JPEG of quality {quality}")
    after = each_picture(spec, delivery, site, lambda _, seq, picture: jpeg(picture, quality))
    return Acted(delivery=after, realised=realised)
