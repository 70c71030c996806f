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


def _from_deep_grey(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """Grey (H, W) of 16 bits, which Pillow would cut off at 255."""
    grey = (np.clip(pixels, 0, 65535).astype(np.uint32) + 128) // 257
    full = np.full_like(grey, 255)
    return np.stack((grey, grey, grey, full), axis=-1).astype(np.uint8)


def _check_size(width: int, height: int) -> None:
    if width < 1 or height < 1 or width * height > MAX_PIXELS:
        raise AssetError(f"an image of {width} x {height} pixels is larger than a texture can be")
