"""web: a running session, or a replay, in a browser."""

from __future__ import annotations

import asyncio
import logging
import socket
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

from elys.common.errors import ElysError
from elys.verbs.nodes import joined, run_until_asked
from elys.verbs.openers import ChildProcesses

if TYPE_CHECKING:
    from elys.bus.access.roles import Role
    from elys.bus.session import Session
    from elys.web_node.node import WebOptions

PATIENCE: Final = 2.0  # [s] without a render node before one is started here
LOOK_INTERVAL: Final = 0.2  # [s]
_WHAT: Final = ("to watch", "to play too", "to edit too")  # of roles, from the least on
_log = logging.getLogger(__name__)


def web(
    connect: str | None,
    *,
    host: str,
    port: int,
    names: tuple[str, ...] = (),
    cert: Path | None = None,
    cert_key: Path | None = None,
    insecure: bool = False,
    role: str = "owner",
    fps: float = 30.0,
    bit_rate: float = 0.0,
    browsers: int = 32,
) -> None:
    """Serves the page until it is told to end. `role` is what anybody may at most, `bit_rate` [Mbit/s] is of H.264."""
    if find_spec("aiohttp") is None:
        raise ElysError("showing a session in a browser needs aiohttp: pip install 'elys[web]'")
    from elys.bus.access.keyring import load_keyring
    from elys.bus.access.roles import role_named, role_of_node
    from elys.bus.discovery import choose_endpoint
    from elys.bus.log import start_logging
    from elys.editor_node.language import LANGUAGES, translations
    from elys.web_node.access import Doorkeeper, new_secrets, secrets_of
    from elys.web_node.doors import is_loopback
    from elys.web_node.node import WebOptions, serve_browsers

    try:
        most = role_named(role)
    except ValueError as error:
        raise ElysError(str(error)) from error
    if cert_key is not None and cert is None:
        raise ElysError("--cert-key is the key of a certificate: give that with --cert as well")
    start_logging()
    endpoint = choose_endpoint(connect)
    options = WebOptions(
        host=host,
        port=port,
        names=names,
        certificate=cert,
        certificate_key=cert_key,
        most_browsers=browsers,
        most_a_second=fps,
        bit_rate=bit_rate * 1e6,
        texts={
            code: translations(code) for code in LANGUAGES
        },  # of components and searches: they are said there and here
    )
    keyring = load_keyring()
    secrets = {} if insecure else secrets_of(keyring) if keyring is not None else new_secrets()
    _warn(options, insecure=insecure, is_near=is_loopback(host))

    async def work() -> None:
        drawing = ChildProcesses()
        try:
            async with joined(endpoint, kind="tool") as session:
                keeper = session.start(_keep_drawn(session, drawing, endpoint))
                allowed = min(most, role_of_node(session.node.id))  # nobody may more than this node itself
                doorkeeper = Doorkeeper(secrets, most=allowed, guest=allowed if insecure else None)
                await serve_browsers(
                    session,
                    doorkeeper,
                    options,
                    on_ready=lambda chosen: print(
                        invitation(session.name, options, chosen, secrets, allowed), flush=True
                    ),
                )
                keeper.cancel()
        finally:
            await drawing.close()

    run_until_asked(work())


def invitation(name: str, options: WebOptions, port: int, secrets: dict[Role, str], most: Role) -> str:
    """What to open, for whom. It is printed and never logged: whoever reads it is let in."""
    address = _address(options, port)
    if not secrets:
        return f"{name} in a browser, for everybody who reaches it: {address}"
    lines = [f"{name} in a browser; give each of these only to whom you mean to let in:"]
    offered = [(role, what) for role, what in zip(sorted(secrets), _WHAT, strict=False) if role <= most]
    lines += [f"  {what:<12} {address}#secret={secrets[role]}" for role, what in offered]
    return "\n".join(lines)


def _address(options: WebOptions, port: int) -> str:
    scheme = "https" if options.is_secure else "http"
    host = options.names[0] if options.names else options.host
    if host in ("0.0.0.0", "::", ""):
        host = socket.gethostname()
    return f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}/"


def _warn(options: WebOptions, *, insecure: bool, is_near: bool) -> None:
    if insecure:
        reach = "of this machine" if is_near else f"who reaches {options.host}"
        _log.warning("no secret is asked for: everybody %s may do here what --role allows", reach)
    elif not is_near and not options.is_secure:
        _log.warning(
            "secrets and pictures travel readably: give --cert and --cert-key, or leave --host out and use "
            "`ssh -L 8090:localhost:8090 HOST`"
        )


async def _keep_drawn(session: Session, drawing: ChildProcesses, endpoint: str) -> None:
    """Starts a render node for a session that has had none for a while."""
    alone = 0.0
    while alone < PATIENCE:
        await asyncio.sleep(LOOK_INTERVAL)
        is_alone = session.connected and not session.nodes_of("render")
        alone = alone + LOOK_INTERVAL if is_alone else 0.0
    if _can_draw():
        _log.info("nobody draws this session: starting a render node beside it")
        await drawing.draw(endpoint)
    else:
        _log.warning("nobody draws this session, and nothing can be drawn here: pip install 'elys[render]'")


def _can_draw() -> bool:
    return all(find_spec(name) is not None for name in ("moderngl", "simplejpeg", "av"))
