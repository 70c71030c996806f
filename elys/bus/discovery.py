"""Sessions on this machine: each host writes a small file into a directory of the user's, and takes it away at the end.

$ELYS_RUNTIME_DIR or the user's runtime directory / sessions / {process}-{port or name}.json
"""

from __future__ import annotations

import asyncio
import logging
import os
import re
import tempfile
import time
from pathlib import Path
from typing import Final

import msgspec

from elys.bus.access.addresses import own_addresses
from elys.bus.access.credentials import Credentials
from elys.bus.access.host import own_credentials
from elys.bus.access.keyring import load_keyring
from elys.bus.session import Node, Session
from elys.bus.streaming.choice import wants_stream
from elys.bus.streaming.client import StreamClient
from elys.bus.topics import is_chunk
from elys.bus.transports.transport import Closer
from elys.bus.transports.zenoh import DEFAULT_PORT, ZenohTransport
from elys.common.assets.store import replace_file
from elys.common.errors import AccessError, BusError, ConnectionLost

_NO_SESSION: Final = (
    "no session is running on this machine: start one with `elys run SCENE`, or name one with --connect tcp/HOST:PORT"
)
_ANY_ADDRESS: Final = re.compile(r"^(tcp|tls)/(0\.0\.0\.0|\[::\]):")
_ENDPOINT: Final = re.compile(
    r"((?P<protocol>[a-z][a-z0-9-]*)/)?(?P<host>[A-Za-z0-9_.-]+|\[[0-9a-fA-F:.%a-z]+\])(:(?P<port>\d{1,6}))?"
)
_log = logging.getLogger(__name__)


class SessionRecord(msgspec.Struct, frozen=True, kw_only=True):
    """What is known of a session without joining it."""

    name: str
    endpoint: str
    pid: int
    kind: str  # simulation or replay
    scene: str
    started: float  # [s] since 1970
    process_started: str = ""  # tells the process from a later one of the same number
    is_behind_router: bool = False  # so that others may be found at its endpoint

    @property
    def place(self) -> str:
        """What to give to `join_session`."""
        return f"{self.name}@{self.endpoint}" if self.is_behind_router else self.endpoint


def runtime_directory() -> Path:
    """Where the sessions of this user on this machine are written down."""
    if chosen := os.environ.get("ELYS_RUNTIME_DIR"):
        return Path(chosen)
    if given := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(given) / "elys"
    return Path(tempfile.gettempdir()) / f"elys-{os.getuid()}"  # no login session: a server, a container


def advertise(*, name: str, endpoint: str, kind: str, scene: str, is_behind_router: bool = False) -> Closer:
    """Lets others on this machine find the session this process hosts, until closed or dead; BusError if it cannot be written."""
    record = SessionRecord(
        name=name,
        endpoint=loopback_endpoint(endpoint),
        pid=os.getpid(),
        kind=kind,
        scene=scene,
        started=time.time(),
        process_started=start_of_process(os.getpid()),
        is_behind_router=is_behind_router,
    )
    folder = runtime_directory() / "sessions"
    path = folder / f"{record.pid}-{re.sub(r'[^A-Za-z0-9]+', '_', record.place)}.json"
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        replace_file(path, msgspec.json.encode(record), durable=False)
    except OSError as error:
        raise BusError(
            f"the session cannot be written down in {folder} ({error.strerror}): set ELYS_RUNTIME_DIR to a directory of yours"
        ) from error
    return lambda: path.unlink(missing_ok=True)


def loopback_endpoint(endpoint: str) -> str:
    """Where processes of this machine reach a host that listens at an endpoint, perhaps of every address."""
    return _ANY_ADDRESS.sub(r"\1/127.0.0.1:", endpoint)


def find_sessions() -> list[SessionRecord]:
    """The sessions that run on this machine, newest first. Files of dead processes are swept away."""
    folder = runtime_directory() / "sessions"
    found = []
    for path in sorted(folder.glob("*.json")):
        try:
            record = msgspec.json.decode(path.read_bytes(), type=SessionRecord)
        except FileNotFoundError:
            continue  # its host has just ended
        except (OSError, msgspec.DecodeError, UnicodeDecodeError) as error:
            _log.warning("%s is no description of a session: %s", path, error)
            continue
        if _is_alive(record):
            found.append(record)
        else:
            path.unlink(missing_ok=True)
    return sorted(found, key=lambda record: -record.started)


def choose_endpoint(connect: str | None = None) -> str:
    """Where to connect: what the user named, else the newest session on this machine. Several have commas between them.

    Both may be a place: `NAME@ENDPOINT` names one of the sessions behind an endpoint, `NAME@` one of this machine.

    Raises:
        ConnectionLost: nothing was named and no session runs here. BusError: what was named is no endpoint, or more is needed.
    """
    name, endpoint = split_place(connect or "")
    if endpoint:
        whole = ",".join(
            map(loopback_endpoint, complete_endpoints(endpoint).split(","))
        )  # every address is this machine's
        return f"{name}@{whole}" if name else whole
    sessions = find_sessions()
    if not sessions:
        raise ConnectionLost(_NO_SESSION)
    chosen = [record for record in sessions if not name or record.name == name]
    if not chosen:
        there = ", ".join(dict.fromkeys(record.name for record in sessions))
        raise ConnectionLost(f"no session {name} runs on this machine; there is {there}")
    beside = [record.name for record in chosen if record.endpoint == chosen[0].endpoint]
    if len(set(beside)) > 1:
        raise BusError(
            f"several sessions run at {chosen[0].endpoint}, {', '.join(beside)}: name one with --session NAME"
        )
    if len(chosen) > 1:
        others = ", ".join(f"{record.name} at {record.endpoint}" for record in chosen[1:])
        _log.info("joining the newest session, %s at %s; there are also %s", chosen[0].name, chosen[0].endpoint, others)
    return chosen[0].place


def split_place(text: str) -> tuple[str, str]:
    """Name ("" if none is given) and endpoint ("" likewise) of `NAME@ENDPOINT`; BusError for a name that no session has."""
    name, at, endpoint = text.rpartition("@")
    if at and not is_chunk(name):
        raise BusError(f"'{name}' is no session's name, which has letters, digits, '.', '_' and '-'")
    return name, endpoint


def complete_place(text: str) -> str:
    """`NAME@HOST` or `HOST`, with or without a port, one or several, as a whole place; BusError for what can be none."""
    name, endpoint = split_place(text)
    return f"{name}@{complete_endpoints(endpoint)}" if name else complete_endpoints(endpoint)


def place_of(connect: str | None, session: str) -> str | None:
    """What `--connect` and `--session` say together; BusError if they name two sessions."""
    if not session:
        return connect
    name, endpoint = split_place(connect or "")
    if name and name != session:
        raise BusError(f"--connect names session {name} and --session {session}: name one of them")
    return f"{session}@{endpoint}"


def complete_endpoint(text: str | None, *, tls: bool = False) -> str:
    """`HOST`, `HOST:PORT` or a whole endpoint as a whole endpoint; BusError for what can be none. None is loopback."""
    text = text or "127.0.0.1"
    found = _ENDPOINT.fullmatch(text)
    port = int(found["port"] or DEFAULT_PORT) if found else 0
    if found is None or not 0 < port < 1 << 16:
        raise BusError(f"'{text}' is no endpoint: give tcp/HOST:PORT, for instance tcp/127.0.0.1:{DEFAULT_PORT}")
    protocol = found["protocol"] or "tcp"
    return f"{'tls' if tls and protocol == 'tcp' else protocol}/{found['host']}:{port}"


def complete_endpoints(text: str) -> str:
    """The same of several with commas between them."""
    return ",".join(complete_endpoint(part.strip()) for part in text.split(","))


async def join_session(
    connect: str | None = None,
    *,
    kind: str,
    timeout: float = 5.0,
    node: Node | None = None,
    credentials: Credentials | None = None,
) -> Session:
    """A session with the host that `connect` names (endpoint or place), or with the newest one on this machine; `node` as for
    `Session.join`.

    Of several endpoints with commas between them the first that answers counts, now and whenever the host has to be found again.
    States come by a stream where the host is behind a network, see `elys.bus.streaming.choice`.
    Without `credentials` those of the environment are shown (ELYS_KEY, ELYS_SECRET), and to hosts of this machine the user's own.

    Raises:
        ConnectionLost: there is none, or nobody answers within `timeout` seconds.
        AccessError: it does not let this side in; the sentence says why.
        ProtocolError: the host speaks another version of the protocol. BusError: several are there, and none was named.
    """
    place = choose_endpoint(connect)
    name, endpoint = split_place(place)
    endpoints = endpoint.split(",")
    shown = credentials or await asyncio.to_thread(credentials_at, endpoints[0])
    try:
        transport = await asyncio.to_thread(ZenohTransport.connect, endpoints, timeout=timeout, credentials=shown)
    except AccessError:
        # A host of this user's that began while it was waited for has made its keys meanwhile.
        own = credentials or Credentials.from_environment()
        again = None if own else await asyncio.to_thread(credentials_for, endpoints[0])
        if again is None or again == shown:
            raise
        shown = again
        transport = await asyncio.to_thread(ZenohTransport.connect, endpoints, timeout=timeout, credentials=shown)
    try:
        session = await Session.join(transport, kind=kind, name=name or "*", timeout=timeout, node=node)
        session.place = place
        if wants_stream(kind, endpoint, session.machine):
            session.states = StreamClient(session, transport.another)
        return session
    except ConnectionLost as error:
        await asyncio.to_thread(transport.close)
        if shown is not None and endpoint.startswith("tls/"):
            raise AccessError(
                f"the session at {endpoint} does not speak with {shown.user}: that key was renewed or revoked; make another with "
                "`elys keys export` on the host's machine"
            ) from error
        raise
    except BaseException:
        await asyncio.to_thread(transport.close)
        raise


def credentials_at(endpoint: str) -> Credentials | None:
    """What to show there, as far as nobody named anything: what the environment says, or to this machine the user's own keys.

    Raises AccessError for what the environment says wrongly.
    """
    return Credentials.from_environment() or credentials_for(endpoint)


def credentials_for(endpoint: str) -> Credentials | None:
    """What this user shows hosts on this machine, unless they ask nobody; None for other machines."""
    from elys.bus.access.refusals import is_open  # many who import this never connect

    found = _ENDPOINT.fullmatch(endpoint)
    if found is None or not is_of_this_machine(found["host"]) or is_open(endpoint):
        return None
    try:
        keyring = load_keyring()
    except AccessError as error:
        _log.warning("%s", error)
        return None
    return own_credentials(keyring) if keyring is not None else None


def is_of_this_machine(host: str) -> bool:
    """Whether a name or address, as it stands in endpoints, is one of loopback or of an interface of this machine."""
    text = host.strip("[]")
    return text == "localhost" or text.startswith("127.") or text in ("::1", *own_addresses())


def _is_alive(record: SessionRecord) -> bool:
    try:
        os.kill(record.pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    if _has_ended(record.pid):
        return False
    now = start_of_process(record.pid)
    return not (now and record.process_started and now != record.process_started)


def _has_ended(pid: int) -> bool:
    """Whether a process is dead and only waits for its parent to look."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return text.rpartition(")")[2].split()[0] in ("Z", "X")


def start_of_process(pid: int) -> str:
    """When a process started, in the kernel's ticks since boot; "" where that cannot be known."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return ""
    return text.rpartition(")")[2].split()[19]
