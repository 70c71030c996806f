"""Pictures as files: PNG for eyes, EXR and .npy for numbers."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from elys.common.errors import AssetError, ElysError
from elys.render_node.scene_classes import SceneClass

NUMBER_SUFFIXES: Final = (".exr", ".npy")
PICTURE_SUFFIXES: Final = (".png", *NUMBER_SUFFIXES)
VIDEO_SUFFIXES: Final = (".mp4",)
# Names of an EXR file's only channel, by what it holds; colours are R, G, B.
CHANNEL_NAMES: Final = {"depth": "Z", "entity": "id", "segmentation": "class"}
LUMINANCE: Final = "Y"
# Red, green, blue and white of sRGB (ITU-R BT.709), x and y of each: what readers would take for granted, said.
CHROMATICITIES: Final = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
# What the numbers are, in words for who opens the file.
MEANINGS: Final = {
    "shaded": "linear radiance, before exposure and tone mapping",
    "normals": "unit normals along the world's axes, 0 for nothing",
    "albedo": "base color, linear",
    "roughness": "roughness, 0 to 1",
    "depth": "metres along the camera's axis, infinite for nothing",
    "entity": "entity ids, 0 for nothing",
    "segmentation": "classes by the numbers of the legend, 0 for nothing",
    "wireframe": "linear colors",
    "overdraw": "how often the pixel was shaded",
}


def output_kind(path: Path) -> Literal["picture", "video"]:
    """What a file of this name is to be; ElysError for other suffixes and where there is no place to write it."""
    suffix = path.suffix.lower()
    if suffix not in PICTURE_SUFFIXES + VIDEO_SUFFIXES:
        known = ", ".join(PICTURE_SUFFIXES + VIDEO_SUFFIXES)
        raise ElysError(
            f"{path} has the suffix {suffix or '(none)'}; pictures and videos that can be written are {known}"
        )
    if path.is_dir():
        raise ElysError(f"{path} is a directory: name a file in it")
    if not path.parent.is_dir():
        raise ElysError(f"{path} cannot be written: there is no directory {path.parent}")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise ElysError(f"{path} cannot be written: permission denied")
    if suffix == ".exr":
        import OpenEXR  # noqa: F401  where it is missing that is said now and not after the work
    return "picture" if suffix in PICTURE_SUFFIXES else "video"


def holds_numbers(path: Path) -> bool:
    """Whether a file of this name holds values as they are instead of colours of a screen."""
    return path.suffix.lower() in NUMBER_SUFFIXES


def save_picture(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Writes RGBA or RGB pixels (H, W, 3 or 4), the upper row first, as an opaque PNG. Raises ElysError."""
    try:
        Image.fromarray(np.ascontiguousarray(pixels[:, :, :3])).save(path, format="PNG")
    except OSError as error:
        raise ElysError(f"{path} cannot be written: {error.strerror or error}") from error


def save_values(path: Path, values: NDArray[Any], *, view: str) -> None:
    """Writes values (H, W, 3 or 1) of a view, the upper row first, to EXR or .npy, where one component is (H, W).

    Numbers are kept exactly: halfs (f16), floats (f32) and ids (u32). Raises ElysError.
    """
    plain = np.ascontiguousarray(values[..., 0] if values.shape[-1] == 1 else values)
    try:
        if path.suffix.lower() == ".npy":
            with path.open("wb") as file:
                np.save(file, plain)
            return
        import OpenEXR  # here: whoever writes other files does without it

        header = {
            "compression": OpenEXR.ZIP_COMPRESSION,
            "type": OpenEXR.scanlineimage,
            "comments": f"ELYS: {MEANINGS.get(view, view)}",
        }
        if plain.ndim == 3 and view != "normals":
            header["chromaticities"] = CHROMATICITIES
        name = "RGB" if plain.ndim == 3 else CHANNEL_NAMES.get(view, LUMINANCE)
        OpenEXR.File(header, {name: plain}).write(str(path))
    except (OSError, RuntimeError) as error:  # the second is what OpenEXR raises
        reason = error.strerror if isinstance(error, OSError) else None
        raise ElysError(f"{path} cannot be written: {reason or error}") from error


def legend_path(output: Path) -> Path:
    """Where the legend of a picture or film of classes is written: beside it."""
    return output.with_name(f"{output.stem}.classes.json")


def save_legend(path: Path, legend: Iterable[SceneClass]) -> None:
    """Writes which class each number means, and the colour that pictures show it by, as JSON. Raises ElysError."""
    lines = ",\n".join("  " + msgspec.json.encode(one._asdict()).decode() for one in legend)  # a line a class
    try:
        path.write_text(f'{{"classes": [\n{lines}\n]}}\n', encoding="utf-8")
    except OSError as error:
        raise ElysError(f"{path} cannot be written: {error.strerror or error}") from error


def load_picture(path: Path) -> NDArray[np.uint8]:
    """The RGB pixels (H, W, 3) of a picture file, the upper row first. Raises AssetError."""
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except OSError as error:
        raise AssetError(f"{path} cannot be read: {error}") from error
