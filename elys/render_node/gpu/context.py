"""A place to draw: OpenGL 3.3 core, offscreen through EGL or in the window that is current."""

from __future__ import annotations

import ctypes
import weakref
from collections import Counter, deque
from typing import Any, Final, Literal

import moderngl

from elys.common.errors import ContextLost, DisplayError

GL_VERSION: Final = 330
Blend = Literal["none", "over", "add"]

_FLAGS: Final = {"over": moderngl.BLEND, "add": moderngl.BLEND, "none": moderngl.NOTHING}
_BLEND_FUNCTIONS: Final = {
    "over": (moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA),
    "add": (moderngl.ONE, moderngl.ONE),
    "none": (moderngl.ONE, moderngl.ZERO),
}
_EGL: Final[dict[str, Any]] = {"backend": "egl"}  # typed as moderngl means it, not as it is annotated there
_PACKAGES: Final = "Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri"
# What EGL says, and what it means. The first that is found in the message counts.
_REMEDIES: Final = (
    ("libEGL", f"the EGL library is not installed ({_PACKAGES})"),
    ("not loaded", f"the EGL library is not installed ({_PACKAGES})"),
    ("found 0 devices", f"EGL knows no vendor: install a driver or Mesa ({_PACKAGES})"),
    ("0x3001", f"EGL found no driver for this machine: install one, or Mesa's software renderer ({_PACKAGES})"),
    ("eglInitialize", f"EGL cannot start the driver: update it, or install Mesa's software renderer ({_PACKAGES})"),
    (
        "requested OpenGL",
        f"the driver offers no OpenGL 3.3: update it, or install Mesa's software renderer ({_PACKAGES})",
    ),
)

# What GL says when it cannot go on. moderngl has no name for a lost context (0x0507): it is the one that it calls unknown.
_FAILURES: Final = {
    "GL_OUT_OF_MEMORY": (
        DisplayError,
        "the graphics card has no memory left; draw smaller pictures, or use fewer and smaller images",
    ),
    "GL_UNKNOWN_ERROR": (
        ContextLost,
        "the driver has lost the context, as when a graphics card is reset; the process that draws has to start again",
    ),
}


class Context:
    """Owns everything made in it. One thread draws; what other threads drop is released at the next `collect`."""

    def __init__(self, gl: Any) -> None:
        self.gl = gl
        self.live: Counter[str] = Counter()  # GL objects that exist, by kind
        self._dropped: deque[tuple[str, Any]] = deque()
        self._max_size = int(gl.info["GL_MAX_TEXTURE_SIZE"])
        name = gl.info["GL_RENDERER"].lower()
        self._is_software = any(software in name for software in ("llvmpipe", "softpipe", "swiftshader", "software"))

    @property
    def info(self) -> dict[str, Any]:
        """What the driver says of itself, by GL's names: GL_RENDERER, GL_VERSION, ..."""
        return dict(self.gl.info)

    @property
    def version_code(self) -> int:
        """330 for OpenGL 3.3."""
        return int(self.gl.version_code)

    @property
    def is_software(self) -> bool:
        """Whether the processor draws."""
        return self._is_software

    @property
    def max_samples(self) -> int:
        """Samples a pixel can have."""
        return int(self.gl.max_samples)

    @property
    def max_size(self) -> int:
        """Longest edge of a texture [pixels]."""
        return self._max_size

    @property
    def live_object_count(self) -> int:
        """How many GL objects exist; the same before and after anything that cleans up behind itself."""
        self.collect()
        return sum(self.live.values())

    def adopt(self, owner: object, kind: str, raw: Any) -> weakref.finalize[[str, Any], Any]:
        """Releases `raw` with its owner: at `finalizer()` or when the owner is garbage, at the latest with the context."""
        self.live[kind] += 1
        # The owner may be collected on a thread on which GL must not be called: only note it there.
        finalizer = weakref.finalize(owner, self._drop, kind, raw)
        finalizer.atexit = False  # the process' end frees everything, in an order in which the driver does not crash
        return finalizer

    def collect(self) -> None:
        """Releases what has lost its owner. Called once a frame on the drawing thread."""
        while self._dropped:
            kind, raw = self._dropped.popleft()
            raw.release()
            self.live[kind] -= 1

    def set_state(
        self,
        *,
        depth_test: Literal["none", "less", "less_equal"] = "none",
        blend: Blend = "none",
        cull: Literal["none", "back", "front"] = "none",
        polygon_offset: tuple[float, float] = (0.0, 0.0),
        wireframe: bool = False,
    ) -> None:
        """All the state a pass depends on: nothing is inherited from what was drawn before."""
        flags = _FLAGS[blend]
        if depth_test != "none":
            flags |= moderngl.DEPTH_TEST
            self.gl.depth_func = "<" if depth_test == "less" else "<="
        if cull != "none":
            flags |= moderngl.CULL_FACE
            self.gl.cull_face = cull
        self.gl.enable_only(flags)
        self.gl.blend_func = _BLEND_FUNCTIONS[blend]
        self.gl.front_face = "ccw"
        self.gl.polygon_offset = polygon_offset
        self.gl.wireframe = wireframe

    def set_culling(self, enabled: bool, *, mirrored: bool = False) -> None:
        """Whether back faces are left out of what is drawn next, and whether a negative scale has turned it inside out."""
        if enabled:
            self.gl.enable(moderngl.CULL_FACE)
            self.gl.cull_face = "back"
        else:
            self.gl.disable(moderngl.CULL_FACE)
        self.gl.front_face = "cw" if mirrored else "ccw"

    def check(self, what: str) -> None:
        """Raises an error if the driver has given up on something since the last call; `what` was being done.

        Raises:
            DisplayError: the card has no memory for it. ContextLost: nothing can be drawn in this process any more.
        """
        error = self.gl.error
        if error == "GL_NO_ERROR" or error not in _FAILURES:
            return  # what a program does wrong is ours to find in tests, and no reason to stop
        kind, reason = _FAILURES[error]
        raise kind(f"{what} failed: {reason}")

    def check_size(self, what: str, width: int, height: int) -> None:
        """Raises DisplayError for images that this driver cannot hold."""
        if not (1 <= width <= self._max_size and 1 <= height <= self._max_size):
            raise DisplayError(
                f"{what} of {width} x {height} pixels cannot be made: this driver takes edges from 1 to {self._max_size}"
            )

    def finish(self) -> None:
        """Waits until everything is drawn."""
        self.gl.finish()

    def release(self) -> None:
        """Ends the context and all in it. Nothing may be drawn afterwards."""
        self.collect()
        self.gl.release()

    def _drop(self, kind: str, raw: Any) -> None:
        self._dropped.append((kind, raw))


def offscreen_context() -> Context:
    """A context that draws into framebuffers only and needs no display. Raises DisplayError with what to install."""
    try:
        return Context(moderngl.create_context(standalone=True, require=GL_VERSION, **_EGL))
    except Exception as error:  # glcontext and moderngl raise plain Exception
        raise DisplayError(_explain("nothing can be drawn offscreen", str(error))) from error


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


def window_context() -> Context:
    """A context over the window that is current on this thread. Raises DisplayError."""
    try:
        return Context(moderngl.create_context(require=GL_VERSION, **_loader()))
    except Exception as error:  # as above
        raise DisplayError(_explain("the window has no OpenGL 3.3", str(error))) from error


def _explain(what: str, message: str) -> str:
    for sign, remedy in _REMEDIES:
        if sign in message:
            return f"{what}: {remedy}. EGL said: {message}"
    return f"{what}: {message}. `elys doctor` looks for the cause"
