"""Thumbnails of assets: images are made small here, what has a shape is sent to a render node. Kept on disk by content.

AssetFile ──image──────────────────────────────> pixels ──> ThumbnailCache
          ──model, light, prefab──> ThumbnailRequest ──render node──^
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import msgspec
import numpy as np
import platformdirs
from numpy.typing import NDArray
from PIL import Image

from elys.bus.messages.views import ThumbnailRequest
from elys.common.assets.images import image_format
from elys.common.assets.store import PREFIX, AssetStore, references_in, replace_file
from elys.common.errors import AssetError
from elys.common.scene import ComponentValues, EntityRecord, SceneSettings, framing_camera, scene_bounds, sun_components
from elys.editor_node.asset_folder import AssetFile

SIZE: Final = 128  # [pixels] of an edge
TEXTURE_SIZE: Final = 256  # [pixels] more are not seen in so small a picture
MAX_CONTENT: Final = 48 << 20  # [bytes] sent along with a request; a message may hold some more
MAX_IMAGE_PIXELS: Final = 1 << 27  # as render nodes take them
CACHE_SIZE: Final = 64 << 20  # [bytes] of thumbnails on the disk above which those used longest ago are thrown away
_BACKDROP: Final = (0.045, 0.048, 0.055)
_SEEN: Final = frozenset({"Transform", "MeshRenderer", "Material", "Skin", "Light", "Environment"})

Pixels = NDArray[np.uint8]


def thumbnail_directory() -> Path:
    """Where thumbnails are kept: $ELYS_CACHE_DIR/thumbnails, or in the user's cache directory."""
    chosen = os.environ.get("ELYS_CACHE_DIR")
    return (Path(chosen) if chosen else Path(platformdirs.user_cache_dir("elys"))) / "thumbnails"


class ThumbnailCache:
    """PNG files by the key of what they show. A disk that refuses makes thumbnails slower and nothing else."""

    def __init__(self, directory: Path | None = None, *, max_size: int = CACHE_SIZE) -> None:
        """Brings the directory, by default that of `thumbnail_directory`, below `max_size` bytes."""
        self._directory = directory or thumbnail_directory()
        with contextlib.suppress(OSError):
            self._directory.mkdir(parents=True, exist_ok=True)
            self._trim(max_size)

    def get(self, key: str) -> Pixels | None:
        """RGBA (H, W, 4), or None where there is none or a damaged one."""
        path = self._path(key)
        try:
            with Image.open(path) as image:
                pixels = np.asarray(image.convert("RGBA"))
            os.utime(path)  # used just now
        except (OSError, ValueError, SyntaxError):
            return None
        return pixels if max(pixels.shape[:2]) <= SIZE else None

    def put(self, key: str, pixels: Pixels) -> None:
        """Keeps a thumbnail."""
        data = io.BytesIO()
        Image.fromarray(pixels).save(data, "PNG")
        with contextlib.suppress(OSError):
            replace_file(self._path(key), data.getvalue(), durable=False)

    def _path(self, key: str) -> Path:
        return self._directory / f"{key.removeprefix(PREFIX)}.png"

    def _trim(self, max_size: int) -> None:
        files = sorted(((p.stat(), p) for p in self._directory.glob("*.png")), key=lambda one: one[0].st_mtime)
        size = sum(stat.st_size for stat, _ in files)
        for stat, path in files:
            if size <= max_size:
                break
            path.unlink(missing_ok=True)
            size -= stat.st_size


def image_thumbnail(data: bytes) -> Pixels:
    """RGBA of an image file, its longer edge at most SIZE. Raises AssetError for what is none."""
    with _opened(data) as image:
        image.draft("RGB", (SIZE * 2, SIZE * 2))  # JPEG is decoded at a smaller size
        return np.asarray(_eight_bits(image, SIZE))


def decoded(data: bytes) -> Pixels:
    """RGBA of a thumbnail that a render node sent. Raises AssetError for what is none."""
    with _opened(data) as image:
        return np.asarray(_eight_bits(image, SIZE))


def thumbnail_request(file: AssetFile, records: Sequence[EntityRecord], assets: AssetStore) -> ThumbnailRequest:
    """What a render node is asked for to show what a file holds; AssetError where that is too much, or a mesh is broken."""
    if file.type == "light":  # is seen in a mirror before it
        ball: ComponentValues = {
            "Transform": {},
            "MeshRenderer": {"mesh": "sphere"},
            "Material": {"base_color": [1.0, 1.0, 1.0], "metallic": 1.0, "roughness": 0.08},
        }
        seen = [*records, EntityRecord(name="Ball", components=ball)]
    else:
        seen = [_seen(record) for record in records]
    present = {name for record in seen for name in record.components}
    if "MeshRenderer" not in present:
        raise AssetError(f"{file.name} has nothing to be seen")
    if not present & {"Light", "Environment"}:
        seen.append(EntityRecord(name="Sun", components=sun_components()))
    seen.append(EntityRecord(name="Camera", components=framing_camera(*scene_bounds(seen, assets))))
    contents: dict[str, bytes] = {}
    size = 0
    for reference in references_in(msgspec.json.encode(seen)):
        if assets.has(reference):
            contents[reference] = _small(assets.get(reference))
            size += len(contents[reference])
    if size > MAX_CONTENT:
        raise AssetError(f"{file.name} holds {size >> 20} MiB, too much to be drawn small")
    settings = SceneSettings(background=_BACKDROP, ambient=(0.35, 0.36, 0.38))
    return ThumbnailRequest(records=tuple(seen), contents=contents, settings=settings, size=SIZE)


def _seen(record: EntityRecord) -> EntityRecord:
    """The record with nothing but what can be seen of it."""
    components = {name: values for name, values in record.components.items() if name in _SEEN}
    references = {key: row for key, row in record.references.items() if key.partition(".")[0] in components}
    return EntityRecord(
        name=record.name, parent=record.parent, enabled=record.enabled, components=components, references=references
    )


def _small(data: bytes) -> bytes:
    """An image made as small as it will be seen; anything else as it is."""
    if image_format(data) not in ("png", "jpeg", "webp", "bmp") or len(data) < 1 << 14:
        return data
    try:
        with _opened(data) as image:
            image.draft("RGB", (TEXTURE_SIZE, TEXTURE_SIZE))
            small = io.BytesIO()
            _eight_bits(image, TEXTURE_SIZE).save(small, "PNG", compress_level=1)
            return small.getvalue()
    except AssetError:
        return data  # the render node says what is wrong with it


@contextlib.contextmanager
def _opened(data: bytes) -> Iterator[Image.Image]:
    """The image in `data`, not decoded yet."""
    try:
        with Image.open(io.BytesIO(data)) as image:
            if image.width * image.height > MAX_IMAGE_PIXELS:
                raise AssetError(f"an image of {image.width} x {image.height} pixels is larger than a texture can be")
            yield image
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise AssetError(f"the image cannot be read: {error}") from error


def _eight_bits(image: Image.Image, size: int) -> Image.Image:
    """RGBA, its longer edge at most `size`."""
    if image.mode in ("I", "I;16", "I;16B", "I;16L", "I;16N"):  # grey of 16 bits, which Pillow would cut off at 255
        grey = np.clip(np.asarray(image).astype(np.float32) / 257.0, 0, 255).astype(np.uint8)
        image = Image.fromarray(grey)
    small = image.convert("RGBA")
    small.thumbnail((size, size), Image.Resampling.BILINEAR)
    return small
