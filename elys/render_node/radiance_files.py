"""Pictures of light from all around, as linear radiance: Radiance (.hdr), OpenEXR (.exr, with the extra `exr`), or any image."""

from __future__ import annotations

import re
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from elys.common.assets import image_format
from elys.common.errors import AssetError
from elys.render_node.images import MAX_PIXELS, decode_image

MAX_RADIANCE: Final = 60000.0  # half floats end at 65504
_SIZE: Final = re.compile(rb"-Y (\d{1,6}) \+X (\d{1,6})\n")

Radiance = NDArray[np.float32]


def decode_radiance(data: bytes) -> Radiance:
    """RGB (H, W, 3), the upper row first; images of 8 bits are taken for sRGB. Raises AssetError for what cannot be read."""
    if image_format(data) == "hdr":
        found = _decode_hdr(data)
    elif image_format(data) == "exr":
        found = _decode_exr(data)
    else:
        found = linear_from_srgb(decode_image(data)[..., :3])
    return np.clip(np.nan_to_num(found, nan=0.0, posinf=MAX_RADIANCE), 0.0, MAX_RADIANCE).astype(np.float32)


def fitted(radiance: Radiance, max_height: int) -> Radiance:
    """A map (H, 2 H, 3) whose height is a power of two, at most `max_height`, of a picture of any shape."""
    height, width = radiance.shape[:2]
    wanted = min(1 << (height - 1).bit_length(), 1 << (max_height.bit_length() - 1))
    if (height, width) == (wanted, 2 * wanted):
        return radiance
    channels = [
        Image.fromarray(np.ascontiguousarray(radiance[..., channel])).resize((2 * wanted, wanted), Image.Resampling.BOX)
        for channel in range(3)
    ]
    return np.stack([np.asarray(channel, np.float32) for channel in channels], axis=-1)


def linear_from_srgb(pixels: NDArray[np.uint8]) -> Radiance:
    """Light of sRGB bytes. IEC 61966-2-1."""
    value = np.arange(256) / 255.0
    table = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4).astype(np.float32)
    return np.asarray(table[pixels])


def _decode_hdr(data: bytes) -> Radiance:
    """Ward, "Real Pixels" (Graphics Gems II): a shared exponent a pixel, rows packed in runs, one channel behind the other."""
    found = _SIZE.search(data[:4096])
    if found is None:
        raise AssetError("an .hdr image whose size is not said as '-Y height +X width'")
    height, width = int(found[1]), int(found[2])
    if height < 1 or width < 1 or height * width > MAX_PIXELS:
        raise AssetError(f"an .hdr image of {width} x {height} pixels is larger than a texture can be")
    packed = np.frombuffer(data, np.uint8, offset=found.end())
    # A row takes at least as many runs as it has to; a short file must not make us reserve a large picture.
    if len(packed) < height * 4:
        raise AssetError(f"an .hdr image ends after {len(packed)} bytes, too few for {height} rows")
    pixels = np.empty((height, width, 4), np.uint8)
    if width < 8 or width > 32767 or packed[0] != 2 or packed[1] != 2:
        if len(packed) < height * width * 4:
            raise AssetError("an .hdr image ends in the middle")
        pixels[:] = packed[: height * width * 4].reshape(height, width, 4)
    else:
        _unpack_rows(bytes(packed), pixels)
    scale = np.ldexp(np.float32(1.0), pixels[..., 3].astype(np.int32) - 136)
    scale[pixels[..., 3] == 0] = 0.0
    return np.asarray(pixels[..., :3] * scale[..., None], np.float32)


def _unpack_rows(packed: bytes, pixels: NDArray[np.uint8]) -> None:
    height, width = pixels.shape[:2]
    at = 0
    for row in range(height):
        if packed[at : at + 4] != bytes((2, 2, width >> 8, width & 255)):
            raise AssetError(f"row {row} of an .hdr image is damaged or is packed in the old way, which is not read")
        at += 4
        for channel in range(4):
            line, filled = bytearray(), 0
            while filled < width:
                count = packed[at] if at < len(packed) else 0
                if count > 128:
                    line += packed[at + 1 : at + 2] * (count - 128)
                    at += 2
                else:
                    line += packed[at + 1 : at + 1 + count]
                    at += 1 + count
                if count == 0 or len(line) <= filled or len(line) > width:
                    raise AssetError(f"row {row} of an .hdr image is damaged")
                filled = len(line)
            pixels[row, :, channel] = np.frombuffer(bytes(line), np.uint8)


def _decode_exr(data: bytes) -> Radiance:
    import tempfile

    try:
        import OpenEXR
    except ImportError as error:
        raise AssetError(
            "an .exr image needs the extra `exr`: pip install 'elys[exr]'; or convert it to .hdr"
        ) from error
    with tempfile.NamedTemporaryFile(suffix=".exr") as file:  # the library reads files only
        file.write(data)
        file.flush()
        try:
            channels: dict[str, Any] = OpenEXR.File(file.name).channels()
        except Exception as error:  # the library raises plain RuntimeError and more
            raise AssetError(f"an .exr image cannot be read: {error}") from error
    for name in ("RGB", "RGBA"):
        if name in channels:
            return np.asarray(channels[name].pixels[..., :3], np.float32)
    if not {"R", "G", "B"} <= channels.keys():
        raise AssetError(f"an .exr image with the channels {', '.join(channels)}; R, G and B are needed")
    return np.stack([np.asarray(channels[name].pixels, np.float32) for name in "RGB"], axis=-1)
