"""The checkerboard: its geometry, and its corners in a picture.

Board frame: origin at the panel's centre, x to the right and y down as seen by who faces it, z away from
them; a board that faces a camera squarely has the camera's axes. Metres. The square at the upper left is
black.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float64, UInt8


class CalibrationError(ValueError):
    """Data that do not determine a calibration. `str(error)` is one sentence."""


@dataclass(frozen=True, kw_only=True)
class Board:
    """A panel with `columns` x `rows` squares in its middle. ValueError: no such board can be told from
    its half turn, or the squares do not leave a white border."""

    columns: int = 8
    rows: int = 5
    square_m: float = 0.13
    width_m: float = 1.2
    height_m: float = 0.9

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or (self.columns - self.rows) % 2 == 0:
            raise ValueError(
                f"a board of {self.columns} x {self.rows} squares looks the same after a half turn or has "
                "too few; allowed: at least 3 x 3, one number even and one odd"
            )
        if not (self.columns * self.square_m < self.width_m and self.rows * self.square_m < self.height_m):
            raise ValueError("the squares leave no white border on the panel")
        if self.width_m <= self.height_m:
            raise ValueError("the panel must be wider than high: its corners are named by its long side")

    @property
    def inner_m(self) -> Float64[np.ndarray, "k 3"]:
        """Where four squares meet, row by row from the upper left."""
        x = (np.arange(1, self.columns) - 0.5 * self.columns) * self.square_m
        y = (np.arange(1, self.rows) - 0.5 * self.rows) * self.square_m
        across, down = np.meshgrid(x, y)
        return np.column_stack([across.ravel(), down.ravel(), np.zeros(across.size)])

    @property
    def outer_m(self) -> Float64[np.ndarray, "4 3"]:
        """The panel's corners: upper left, upper right, lower right, lower left."""
        x, y = 0.5 * self.width_m, 0.5 * self.height_m
        return np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])

    @property
    def black(self) -> Bool[np.ndarray, "r c"]:
        """Which squares are black, from the upper left."""
        parity: np.ndarray = np.add.outer(np.arange(self.rows), np.arange(self.columns)) % 2 == 0
        return parity


def find_corners(grey: UInt8[np.ndarray, "h w"], board: Board) -> Float64[np.ndarray, "k 2"] | None:
    """The inner corners of the board in a picture, [k 2] pixels in the order of `Board.inner_m`; None: not
    found.

    By `cv2.findChessboardCornersSB` (Duda and Frese 2018, "Accurate detection and localization of
    checkerboard corners for calibration", BMVC), whose pixel centres are at whole numbers; ours are at
    halves. A half turn is undone by the squares' colours.
    """
    shape = (board.columns - 1, board.rows - 1)
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    found, corners = cv2.findChessboardCornersSB(grey, shape, flags=flags)
    if not found or corners is None:
        return None
    corners_px = np.asarray(corners, dtype=np.float64).reshape(-1, 2)
    if _contrast(grey, corners_px, board) < 0.0:
        corners_px = corners_px[::-1].copy()
    return corners_px + 0.5


def _contrast(grey: UInt8[np.ndarray, "h w"], corners_px: Float64[np.ndarray, "k 2"], board: Board) -> float:
    """How much brighter the inner squares are that should be white than those that should be black."""
    grid = corners_px.reshape(board.rows - 1, board.columns - 1, 2)
    middle = 0.25 * (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:])
    column = np.clip(np.rint(middle[..., 0]).astype(int), 0, grey.shape[1] - 1)
    row = np.clip(np.rint(middle[..., 1]).astype(int), 0, grey.shape[0] - 1)
    shown, black = grey[row, column].astype(np.float64), board.black[1:-1, 1:-1]
    return float(shown[~black].mean() - shown[black].mean())
