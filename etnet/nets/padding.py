"""Zero padding to a multiple of the coarsest stride, and the token grid that follows from it."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import pad

PATCH = 8
"""Pixels on a token's side (paper, P)."""


@dataclass(frozen=True, slots=True)
class TokenGrid:
    """The H/8 × W/8 grid that all scales share, and where it lies over a sensor of `height` × `width`."""

    height: int
    width: int

    @property
    def rows(self) -> int:
        """Token rows."""
        return -(-self.height // PATCH)

    @property
    def columns(self) -> int:
        """Token columns."""
        return -(-self.width // PATCH)

    @property
    def num_tokens(self) -> int:
        """Rows × columns."""
        return self.rows * self.columns

    @property
    def top(self) -> int:
        """Rows of zeros above the image: the larger half."""
        return (self.rows * PATCH - self.height + 1) // 2

    @property
    def left(self) -> int:
        """Columns of zeros left of the image: the larger half."""
        return (self.columns * PATCH - self.width + 1) // 2

    def token_at(self, x: int, y: int) -> int:
        """The raster index of the token over pixel (x, y) of the sensor."""
        if not (0 <= x < self.width and 0 <= y < self.height):
            raise ValueError(f"pixel ({x}, {y}) lies outside the sensor of {self.width} × {self.height}")
        return (y + self.top) // PATCH * self.columns + (x + self.left) // PATCH

    def pixel_of(self, token: int) -> tuple[int, int]:
        """The sensor pixel (x, y) nearest to the token's middle."""
        row, column = divmod(token, self.columns)
        x = column * PATCH + PATCH // 2 - self.left
        y = row * PATCH + PATCH // 2 - self.top
        return min(max(x, 0), self.width - 1), min(max(y, 0), self.height - 1)


def pad_to_grid(image: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c hp wp"]:
    """Zeros around the image up to a multiple of 8; top and left get the larger half (as the released code)."""
    grid = TokenGrid(image.shape[-2], image.shape[-1])
    bottom = grid.rows * PATCH - grid.height - grid.top
    right = grid.columns * PATCH - grid.width - grid.left
    if not (grid.top or grid.left or bottom or right):
        return image
    return pad(image, (grid.left, right, grid.top, bottom))


def crop_to_sensor(image: Float[Tensor, "b c hp wp"], height: int, width: int) -> Float[Tensor, "b c h w"]:
    """Undo `pad_to_grid`."""
    grid = TokenGrid(height, width)
    return image[..., grid.top : grid.top + height, grid.left : grid.left + width]
