"""The editor's own share of OpenGL: the window's context, the texture of the viewport and reading the window back.

Everything else on the screen is drawn by Dear ImGui's backend, the scene by a render node.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Hashable, Sequence
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from elys.common.errors import DisplayError

UNSEEN_FRAMES: Final = 16  # of which one is really drawn where none is shown
K = TypeVar("K", bound=Hashable)


class _WindowFunctions:
    """OpenGL's functions as GLFW finds them: right for X11, Wayland and no display alike, whatever other contexts there are."""

    def load_opengl_function(self, name: str) -> int:
        """The address of a function; 0 where there is none."""
        import glfw  # loaded with the window, which chose whose library it is

        return ctypes.cast(glfw.get_proc_address(name), ctypes.c_void_p).value or 0

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def release(self) -> None:
        """The window ends its context."""


def _loader() -> dict[str, Any]:
    """As moderngl takes it."""
    return {"context": _WindowFunctions()}


class WindowContext:
    """OpenGL 3.3 in the window whose context is current on this thread."""

    def __init__(self) -> None:
        self._unseen = 0  # frames since the last that was finished
        try:
            self._context = moderngl.create_context(require=330, **_loader())
        except Exception as error:  # moderngl raises plain Exception
            raise DisplayError(
                f"the window has no OpenGL 3.3 ({error}): update the graphics driver, or install Mesa's software one "
                "(Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri)"
            ) from error

    @property
    def renderer(self) -> str:
        """What draws, in the driver's words."""
        return str(self._context.info["GL_RENDERER"])

    def clear(self, width: int, height: int, color: Sequence[float]) -> None:
        """Starts a frame of the window; ImGui's backend binds no framebuffer of its own."""
        self._context.screen.use()
        self._context.viewport = (0, 0, width, height)
        red, green, blue = color[:3]
        self._context.screen.clear(red, green, blue, 1.0)

    def retire_unseen(self) -> None:
        """Ends a frame that no display shows. Call it after each one there.

        Elsewhere showing a frame lets the driver finish it. Where nothing is shown Mesa would keep what each frame is to be
        drawn from, a megabyte and more, until somebody asks for a pixel.
        """
        self._unseen = (self._unseen + 1) % UNSEEN_FRAMES
        if self._unseen == 0:
            self._context.finish()

    def read_window(self, width: int, height: int) -> NDArray[np.uint8]:
        """What the window shows, [height, width, 4] RGBA from the top row down."""
        data = self._context.screen.read(viewport=(0, 0, width, height), components=4, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(height, width, 4)[::-1]

    def picture(self) -> ViewportPicture:
        """A texture to show pictures of the scene with."""
        return ViewportPicture(self._context)

    def texture_of(self, pixels: NDArray[np.uint8]) -> Any:
        """A texture of RGBA pixels [height, width, 4], the upper row first; whoever asks releases it."""
        height, width, _ = pixels.shape
        texture = self._context.texture((width, height), 4, np.ascontiguousarray(pixels).tobytes(), alignment=1)
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        return texture

    def release(self) -> None:
        """Gives the context back."""
        self._context.release()


class ViewportPicture:
    """The newest picture of a view. Rows stand as GL reads them: the bottom one first."""

    def __init__(self, context: Any) -> None:
        self._context = context
        self._texture: Any = None
        self._outgrown: list[Any] = []  # of older sizes, perhaps still in a draw list that is not drawn yet

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [pixels]; (0, 0) before the first upload."""
        return self._texture.size if self._texture is not None else (0, 0)

    @property
    def name(self) -> int:
        """GL's name of the texture, for ImGui."""
        return self._texture.glo if self._texture is not None else 0

    def upload(self, pixels: bytes | memoryview | NDArray[np.uint8], width: int, height: int) -> None:
        """Shows `width * height` RGBA pixels from now on, straight from any buffer."""
        for texture in self._outgrown:
            texture.release()
        self._outgrown.clear()
        if self.size != (width, height):
            if self._texture is not None:
                self._outgrown.append(self._texture)
            self._texture = self._context.texture((width, height), 4)
            self._texture.swizzle = "RGB1"  # what a renderer leaves in alpha must not let the window shine through
        self._texture.write(pixels, alignment=1)

    def read(self) -> NDArray[np.uint8]:
        """What is shown, (height, width, 4); (0, 0, 4) before the first upload."""
        width, height = self.size
        content = self._texture.read() if self._texture is not None else b""
        return np.frombuffer(content, np.uint8).reshape(height, width, 4)

    def release(self) -> None:
        """Frees the textures."""
        for texture in (*self._outgrown, self._texture):
            if texture is not None:
                texture.release()
        self._outgrown.clear()
        self._texture = None


class TextureShelf(Generic[K]):
    """Small pictures on the card by key: as many as are seen, a few new ones a frame, so that no frame waits for them."""

    def __init__(self, make: Callable[[NDArray[np.uint8]], Any], *, uploads: int = 8) -> None:
        """`make` gives a texture with `glo` and `release`; at most `uploads` a frame."""
        self._make = make
        self._uploads = uploads
        self._left = uploads
        self._textures: dict[K, Any] = {}
        self._seen: set[K] = set()
        self.is_behind = False  # whether a picture asked for since `begin_frame` has to wait for the next

    def __len__(self) -> int:
        return len(self._textures)

    def begin_frame(self) -> None:
        """Frees what the last frame did not show. Call it before each frame is built, shown pictures or not."""
        for key in self._textures.keys() - self._seen:
            self._textures.pop(key).release()
        self._seen.clear()
        self._left, self.is_behind = self._uploads, False

    def name(self, key: K, pixels: NDArray[np.uint8]) -> int:
        """GL's name of the picture's texture, for ImGui; 0 where it comes in a later frame only."""
        texture = self._textures.get(key)
        if texture is None:
            if not self._left:
                self.is_behind = True
                return 0
            self._left -= 1
            texture = self._textures[key] = self._make(pixels)
        self._seen.add(key)
        return int(texture.glo)

    def release(self) -> None:
        """Frees all."""
        self._seen.clear()
        self.begin_frame()


def save_picture(pixels: NDArray[np.uint8], path: str | Path) -> None:
    """Writes [height, width, 4] RGBA pixels as an opaque picture; the file's ending names the format."""
    from PIL import Image

    Image.fromarray(np.ascontiguousarray(pixels[..., :3])).save(path)
