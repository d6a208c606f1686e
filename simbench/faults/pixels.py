"""What pictures lose: light, sharpness, bytes."""

from __future__ import annotations

from scenarios.faults.camera import Defocus, Dirt, ExtraNoise, JpegLoss, LowLight, WrongExposure
from simbench.faults.code_receipts import jpeg_receipts
from simbench.faults.fault import DeliveryFault
from simbench.faults.lens_receipts import defocus_receipts, dirt_receipts
from simbench.faults.pixel_receipts import exposure_receipts, low_light_receipts, noise_receipts
from simbench.faults.pixels_code import compress
from simbench.faults.pixels_lens import defocus, soil
from simbench.faults.pixels_light import add_noise, darken, expose

DELIVERED: tuple[DeliveryFault, ...] = (
    DeliveryFault(spec=Dirt, act=soil, receipts=dirt_receipts),
    DeliveryFault(spec=Defocus, act=defocus, receipts=defocus_receipts),
    DeliveryFault(spec=WrongExposure, act=expose, receipts=exposure_receipts),
    DeliveryFault(spec=LowLight, act=darken, receipts=low_light_receipts),
    DeliveryFault(spec=ExtraNoise, act=add_noise, receipts=noise_receipts),
    DeliveryFault(spec=JpegLoss, act=compress, receipts=jpeg_receipts),
)
"""In the order in which light meets them: the lens, the shutter, the sensor, the coder."""
