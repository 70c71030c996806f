"""doctor: what ELYS needs of this machine, one check a function, each with its remedy."""

from __future__ import annotations

import asyncio
import importlib
import platform
from collections.abc import Callable
from typing import Final, Literal

import msgspec

import elys
from elys.common.errors import BusError, DisplayError
from elys.verbs.output import print_json, size_text

State = Literal["good", "missing", "broken"]


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """What a check found. `missing` limits what can be done; `broken` must be mended."""

    check: str
    state: State
    detail: str
    remedy: str = ""


def doctor(*, json: bool) -> int:
    """Prints all findings; the exit status is 1 if anything is broken."""
    findings = [check() for check in CHECKS]
    if json:
        print_json(findings)
    else:
        for finding in findings:
            mark = {"good": "ok", "missing": "--", "broken": "!!"}[finding.state]
            print(f"{mark}  {finding.check:<18} {finding.detail}")
            if finding.remedy:
                print(f"    {'':<18} to mend: {finding.remedy}")
    return 1 if any(finding.state == "broken" for finding in findings) else 0


def check_python() -> Finding:
    """The interpreter and the release."""
    detail = f"ELYS {elys.__version__}, Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    return Finding(check="python", state="good", detail=detail)


def check_packages() -> Finding:
    """The libraries of all extras."""
    absent = []
    for extra, module in (("render", "moderngl"), ("render", "glfw"), ("render", "av"), ("editor", "imgui_bundle")):
        try:
            importlib.import_module(module)
        except ImportError:
            absent.append((extra, module))
    if not absent:
        return Finding(check="packages", state="good", detail="simulation, render and editor are installed")
    names = ", ".join(module for _, module in absent)
    return Finding(
        check="packages",
        state="missing",
        detail=f"without {names}: the simulation runs, but nothing is drawn here",
        remedy=f"pip install 'elys[{absent[-1][0]}]'",
    )


def check_bus() -> Finding:
    """A zenoh session with itself over loopback."""
    from elys.bus.session import Session
    from elys.bus.transports.zenoh import ZenohTransport

    async def say_hello() -> str:
        host_side = await asyncio.to_thread(ZenohTransport.listen_on_free_port, first_port=17447)
        host = await Session.host(host_side, name="doctor", kind="simulation", epoch=1)
        guest_side = await asyncio.to_thread(ZenohTransport.connect, host_side.endpoint, timeout=3.0)
        guest = await Session.join(guest_side, kind="tool", timeout=3.0)
        await guest.close()
        await host.close()
        return host_side.endpoint

    try:
        endpoint = asyncio.run(say_hello())
    except BusError as error:
        return Finding(
            check="bus",
            state="broken",
            detail=f"zenoh cannot talk over loopback: {error}",
            remedy="allow TCP on 127.0.0.1 (a firewall or a sandbox forbids it)",
        )
    return Finding(check="bus", state="good", detail=f"zenoh talks over loopback ({endpoint})")


def check_kernels() -> Finding:
    """The compiled kernels."""
    from elys.sim_node.kernel_cache import kernel_cache_report

    report = kernel_cache_report()
    detail = (
        f"{report.present} of {report.total} compiled for {report.level}, {size_text(report.size)} in {report.path}"
    )
    if report.missing:
        return Finding(
            check="kernels",
            state="missing",
            detail=detail,
            remedy="nothing: the first run compiles them once, with a progress bar",
        )
    return Finding(check="kernels", state="good", detail=detail)


def check_opengl() -> Finding:
    """Drawing without a window."""
    try:
        from elys.render_node.gpu.context import offscreen_context

        context = offscreen_context()
    except ImportError as error:
        return Finding(check="opengl", state="missing", detail=str(error), remedy="pip install 'elys[render]'")
    except DisplayError as error:
        return Finding(check="opengl", state="missing", detail=f"cannot draw offscreen: {error}", remedy=GL_REMEDY)
    detail = f"offscreen, {context.info['GL_RENDERER']}, OpenGL {context.version_code / 100:.1f}"
    context.release()
    return Finding(check="opengl", state="good", detail=detail)


def check_display() -> Finding:
    """A window."""
    try:
        from elys.render_node.window import probe_display

        detail = probe_display()
    except ImportError as error:
        return Finding(check="display", state="missing", detail=str(error), remedy="pip install 'elys[render]'")
    except DisplayError as error:
        return Finding(
            check="display",
            state="missing",
            detail=f"no window can be opened: {error}",
            remedy="use a desktop session, `xvfb-run -a elys ...`, or --headless and `elys render`",
        )
    return Finding(check="display", state="good", detail=detail)


GL_REMEDY: Final = "sudo apt install libegl1 libgl1 libgl1-mesa-dri libgles2"
CHECKS: Final[tuple[Callable[[], Finding], ...]] = (
    check_python,
    check_packages,
    check_bus,
    check_kernels,
    check_display,  # before OpenGL: a GLX window in a process that has drawn through EGL ends it with an X error
    check_opengl,
)
