"""What the detector makes of what it sees."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from scenarios.faults.spec import FaultSpec, Severity


class EdgeError(FaultSpec):
    """The detector's box edges are off, and stay off for a while.

    Each edge moves outward by side * (bias_fraction + a_t), side being the box's width or height.
    a_t is AR(1) noise of SD sd_fraction with time constant tau_s: a_t = r a_(t-dt) + sqrt(1 - r^2) sd n_t,
    r = exp(-dt / tau_s); tau_s 0 is white noise.
    Unit: share of the box's side. Source: judgement (SD 3 %, 0.3 s): white jitter alone flatters smoothers.
    """

    name: ClassVar[str] = "detector.edge_error"
    strength: ClassVar[str] = "sd_fraction"
    zero_when_off: ClassVar[tuple[str, ...]] = ("sd_fraction", "bias_fraction")
    unit: ClassVar[str] = "fraction of the side"

    sd_fraction: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.03
    tau_s: Annotated[float, Field(ge=0, le=60, allow_inf_nan=False)] = 0.3
    bias_fraction: Annotated[float, Field(ge=-0.5, le=1, allow_inf_nan=False)] = 0.0


SPECS: tuple[type[FaultSpec], ...] = (EdgeError,)
SEVERITIES: tuple[Severity, ...] = ()
