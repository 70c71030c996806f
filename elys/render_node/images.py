"""Image files into pixels, as textures want them."""

from __future__ import annotations

import io
from typing import Any, Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from PIL import Image

from elys.common.assets import image_format
from elys.common.errors import AssetError

MAX_PIXELS: Final = 1 << 27  # half a gibibyte: a few bytes of PNG can claim any size
_INKS: Final = ("CMYK", "YCCK")  # which the faster decoder does not turn into light


def decode_image(data: bytes) -> NDArray[np.uint8]:
    """RGBA pixels (H, W, 4), the upper row first, in the file's own encoding (sRGB or linear, as its use says).

    Raises:
        AssetError: the bytes are no image, or a damaged one, or one of unreasonable size.
    """
    kind = image_format(data)
    try:
        if kind == "jpeg":
            height, width, colors, _ = simplejpeg.decode_jpeg_header(data)
            _check_size(width, height)
            if colors not in _INKS:
                return np.asarray(simplejpeg.decode_jpeg(data, colorspace="RGBA"))
        with Image.open(io.BytesIO(data)) as image:
            _check_size(*image.size)
            if image.mode in ("I", "I;16", "I;16B", "I;16L", "I;16N"):
                return _from_deep_grey(np.asarray(image))
            return np.asarray(image.convert("RGBA"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise AssetError(f"a {kind or 'file that is no'} image cannot be read: {error}") from error


def shrunk(pixels: NDArray[np.uint8], largest: int, *, is_color: bool) -> NDArray[np.uint8]:
    """RGBA pixels (H, W, 4) averaged over the fewest n by n that leave no edge longer than `largest`; colours as light, since
    the mean of what sRGB stores is too dark.
    """
    step = -(-max(pixels.shape[:2]) // largest)
    if step <= 1:
        return pixels
    value_of = np.tile(np.arange(256, dtype=np.float32)[:, None], 4)  # [256, 4] of each channel's bytes
    if is_color:
        value_of[:, :3] = _light_of_srgb(value_of[:, :3] / 255.0) * 255.0
    rows, columns = np.arange(0, pixels.shape[0], step), np.arange(0, pixels.shape[1], step)
    made = np.empty((len(rows), len(columns), 4), np.uint8)
    for row, first in enumerate(rows):  # in 32 bits the whole would take four times the room
        strip = pixels[first : first + step]
        values = np.stack([value_of[strip[..., channel], channel].sum(axis=0) for channel in range(4)], axis=-1)
        counts = np.minimum(columns + step, pixels.shape[1]) - columns
        mean = np.add.reduceat(values, columns, axis=0) / (counts[:, None] * len(strip))
        if is_color:
            mean[:, :3] = _srgb_of_light(mean[:, :3] / 255.0) * 255.0
        made[row] = np.rint(mean)
    return made


def _light_of_srgb(shown: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _srgb_of_light(light: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055).astype(np.float32)


def _from_deep_grey(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """Grey (H, W) of 16 bits, which Pillow would cut off at 255."""
    grey = (np.clip(pixels, 0, 65535).astype(np.uint32) + 128) // 257
    full = np.full_like(grey, 255)
    return np.stack((grey, grey, grey, full), axis=-1).astype(np.uint8)


def _check_size(width: int, height: int) -> None:
    if width < 1 or height < 1 or width * height > MAX_PIXELS:
        raise AssetError(f"an image of {width} x {height} pixels is larger than a texture can be")
