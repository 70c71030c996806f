"""Meshes and images by name, decoded off the drawing thread: what is not here yet is asked for and drawn when it comes."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets import Mesh, decode_mesh, is_primitive, primitive
from elys.common.assets.skin import SkinBinding, decode_skin, joint_bounds
from elys.common.errors import AssetError, ElysError
from elys.render_node.images import decode_image
from elys.render_node.radiance_files import decode_radiance

FIRST_PAUSE: Final = 1.0  # [s] until what could not be had is asked for again, and twice as long each time it fails
LONGEST_PAUSE: Final = 60.0  # [s]
THREAD_COUNT: Final = 24  # that wait for what they fetch: from far away a round trip each, so all at the same time
DECODING_COUNT: Final = 2  # of them at work at the same time: decoding scales to two (measured)


class Extent(NamedTuple):
    """Where a mesh is in its own space [m]: the corners of a box, and the radius of a sphere around the box' middle."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    radius: float


Take = Callable[[str, bytes], None]


class _Setback(NamedTuple):
    """What could not be had, but may be later."""

    take: Take
    pause: float  # [s] after the last time
    due: float  # [s] by the clock


# Of what is not here yet: never culled for being too small, and no reason to look elsewhere.
UNKNOWN_EXTENT: Final = Extent((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1e3)
_log = logging.getLogger(__name__)


class DrawableAssets:
    """A cache in front of `fetch`, which gives the bytes of a reference or raises an ElysError, and may block.

    `on_ready` is called, on any thread, when something asked for has come or cannot be had; `version` rises when a mesh or skin
    came or failed. What could not be had is asked for again by `retry_due`, later each time; what came and holds nothing that can
    be drawn is not, for the same name means the same bytes.
    """

    def __init__(
        self,
        fetch: Callable[[str], bytes] | None = None,
        *,
        on_ready: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
        source_of: Callable[[str], str] = lambda _: "",
    ) -> None:
        """`source_of` says which file a reference comes from, "" where that is not known."""
        self._fetch = fetch
        self._on_ready = on_ready
        self._clock = clock
        self._source_of = source_of
        self._setbacks: dict[str, _Setback] = {}
        self._lock = threading.Lock()
        self._meshes: dict[str, Mesh] = {}
        self._skins: dict[str, SkinBinding] = {}
        self._extents: dict[str, Extent] = {}
        self._joint_bounds: dict[tuple[str, int], tuple[NDArray[np.float32], NDArray[np.float32]]] = {}
        self._morph_reaches: dict[str, NDArray[np.float32]] = {}
        self._images: dict[str, NDArray[np.uint8]] = {}
        self._radiances: dict[str, NDArray[np.float32]] = {}
        self._pending: dict[str, Future[None]] = {}
        self._pool: ThreadPoolExecutor | None = None
        self._decoding = threading.BoundedSemaphore(DECODING_COUNT)
        self.failed: dict[str, str] = {}  # reference -> why
        self.version = 0

    def mesh(self, name: str) -> Mesh | None:
        """The mesh of that name, None while it is on its way or if it cannot be had."""
        if is_primitive(name):
            return primitive(name)
        with self._lock:
            if name in self._meshes:
                return self._meshes[name]
        self._ask(name, self._take_mesh)
        return None

    def skin(self, reference: str) -> SkinBinding | None:
        """The joints of a skin, None while they are on their way or if they cannot be had."""
        with self._lock:
            if reference in self._skins:
                return self._skins[reference]
        self._ask(reference, self._take_skin)
        return None

    def take_image(self, reference: str) -> NDArray[np.uint8] | None:
        """The pixels (H, W, 4), given away: asked again, the image is decoded again. None while it is on its way."""
        with self._lock:
            pixels = self._images.pop(reference, None)
        if pixels is None:
            self._ask(reference, self._take_image)
        return pixels

    def radiance(self, reference: str) -> NDArray[np.float32] | None:
        """An image as linear light (H, W, 3). None while it is on its way or if it cannot be had."""
        with self._lock:
            radiance = self._radiances.get(reference)
        if radiance is None:
            self._ask(reference, self._take_radiance)
        return radiance

    def extent_of(self, name: str) -> Extent:
        """How large a mesh is."""
        if name not in self._extents:
            mesh = self.mesh(name)
            if mesh is None:
                return UNKNOWN_EXTENT
            self._extents[name] = _extent(mesh)
        return self._extents[name]

    def is_surface(self, name: str) -> bool:
        """Whether a mesh consists of triangles; of one that is not here yet it is taken for granted."""
        mesh = self.mesh(name)
        return mesh is None or mesh.is_surface

    def joint_bounds(self, name: str, joint_count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Boxes (J, 3) around what each joint bends of a mesh that is here, see `skin.joint_bounds`."""
        key = (name, joint_count)
        if key not in self._joint_bounds:
            mesh = self.mesh(name)
            assert mesh is not None
            self._joint_bounds[key] = joint_bounds(mesh, joint_count)
        return self._joint_bounds[key]

    def morph_reach(self, name: str) -> NDArray[np.float32]:
        """How far each morph target (T, 3) draws any vertex of a mesh that is here, along each axis [m]."""
        if name not in self._morph_reaches:
            mesh = self.mesh(name)
            assert mesh is not None
            assert mesh.target_positions is not None
            self._morph_reaches[name] = np.abs(mesh.target_positions).max(axis=1, initial=0.0)
        return self._morph_reaches[name]

    def settle(self, timeout: float = 60.0) -> None:
        """Waits until nothing is on its way, at most `timeout` seconds."""
        with self._lock:
            pending = list(self._pending.values())
        wait(pending, timeout=timeout)

    @property
    def is_busy(self) -> bool:
        """Whether anything is on its way."""
        with self._lock:
            return bool(self._pending)

    def wait_for_one(self, timeout: float) -> bool:
        """Waits until something that is on its way has come, at most `timeout` seconds; False if nothing is, or time is up."""
        with self._lock:
            pending = list(self._pending.values())
        return bool(pending) and bool(wait(pending, timeout=max(timeout, 0.0), return_when=FIRST_COMPLETED).done)

    def retry_failed(self) -> None:
        """Forgets what could not be had, as when another host may have it."""
        with self._lock:
            self.failed.clear()
            self._setbacks.clear()
            self.version += 1

    def told(self, reference: str) -> str:
        """What people are told of a reference: its file, where that is known."""
        source = self._source_of(reference)
        return f"{source} ({reference})" if source else reference

    def give_up(self, reference: str, reason: str) -> None:
        """Notes that something came in vain, as where the graphics card has no room for it; says so."""
        _log.warning("drawn without %s: %s", self.told(reference), reason)
        with self._lock:
            self._setbacks.pop(reference, None)
        self._fail(reference, reason)

    @property
    def retry_pause(self) -> float | None:
        """Seconds until `retry_due` asks for something again; None where nothing waits for that."""
        with self._lock:
            due = [setback.due for name, setback in self._setbacks.items() if name not in self._pending]
        return max(0.0, min(due) - self._clock()) if due else None

    def retry_due(self) -> None:
        """Asks again for what could not be had, where its time has come. It counts as failed until it is here."""
        now = self._clock()
        with self._lock:
            for name, setback in self._setbacks.items():
                if setback.due <= now and name not in self._pending:
                    self._submit(name, setback.take)

    def close(self) -> None:
        """Ends the threads; what is on its way is given up."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)

    def _ask(self, reference: str, take: Take) -> None:
        with self._lock:
            if reference not in self._pending and reference not in self.failed:
                self._submit(reference, take)

    def _submit(self, reference: str, take: Take) -> None:
        """With the lock held."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(THREAD_COUNT, thread_name_prefix="elys-assets")
        self._pending[reference] = self._pool.submit(self._load, reference, take)

    def _load(self, reference: str, take: Take) -> None:
        try:
            data = self._got(reference, take)
            if data is not None:
                with self._decoding:
                    take(reference, data)
                self._recover(reference)
        except ElysError as error:
            self.give_up(reference, str(error))
        except MemoryError:
            self.give_up(reference, "there is not memory enough to decode it; use fewer and smaller images and meshes")
        except Exception as error:
            _log.exception("drawn without %s", self.told(reference))
            self._fail(reference, str(error))
        finally:
            self._on_ready()

    def _got(self, reference: str, take: Take) -> bytes | None:
        """The bytes; None where they cannot be had now, which is said the first time."""
        try:
            if self._fetch is None:
                raise AssetError(f"there is no asset {reference!r}: nobody serves any")
            return self._fetch(reference)
        except (ElysError, TimeoutError) as error:
            reason = str(error) or "nobody has answered in time"
        with self._lock:
            before = self._setbacks.get(reference)
            pause = FIRST_PAUSE if before is None else min(2.0 * before.pause, LONGEST_PAUSE)
            self._setbacks[reference] = _Setback(take, pause, self._clock() + pause)
            if before is not None:
                self._pending.pop(reference, None)  # else where it counts as failed, lest it is asked for in between
        if before is None:
            _log.warning("drawn without %s, until it comes: %s", self.told(reference), reason)
            self._fail(reference, reason)
        return None

    def _recover(self, reference: str) -> None:
        with self._lock:
            if self._setbacks.pop(reference, None) is None:
                return
            self.failed.pop(reference, None)
            self.version += 1
        _log.info("%s has come", reference)

    def _fail(self, reference: str, reason: str) -> None:
        with self._lock:
            self.failed[reference] = reason
            self.version += 1
            self._pending.pop(reference, None)

    # --- what came, kept in the same breath in which it is on its way no more: an image may be asked for again at once

    def _take_mesh(self, reference: str, data: bytes) -> None:
        mesh = decode_mesh(data)
        extent = _extent(mesh)  # here, where other threads go on
        with self._lock:
            self._meshes[reference] = mesh
            self._pending.pop(reference, None)
            self._extents[reference] = extent
            self.version += 1

    def _take_skin(self, reference: str, data: bytes) -> None:
        skin = decode_skin(data)
        with self._lock:
            self._skins[reference] = skin
            self._pending.pop(reference, None)
            self.version += 1

    def _take_image(self, reference: str, data: bytes) -> None:
        pixels = decode_image(data)
        with self._lock:
            self._images[reference] = pixels
            self._pending.pop(reference, None)

    def _take_radiance(self, reference: str, data: bytes) -> None:
        radiance = decode_radiance(data)
        with self._lock:
            self._radiances[reference] = radiance
            self._pending.pop(reference, None)
            self.version += 1


def _extent(mesh: Mesh) -> Extent:
    if not mesh.vertex_count:
        return Extent((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
    lower, upper = (corner.astype(np.float64) for corner in mesh.bounds)
    offset = mesh.positions - (lower + upper) / 2
    radius = math.sqrt(float(np.einsum("ij,ij->i", offset, offset).max()))
    return Extent(tuple(lower.tolist()), tuple(upper.tolist()), radius)
