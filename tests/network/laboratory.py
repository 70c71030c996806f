"""Several machines on one: network namespaces, and links between them that are slow, lossy, narrow or cut.

    with Laboratory(folder) as lab:
        server, laptop = lab.machines("server", "laptop")
        link = lab.link(server, laptop, delay=0.05, loss=0.02)
        simulation = server.start("run", "yard", "--headless", "--listen", "tcp/0.0.0.0:7447")
        viewer = laptop.start("view", "--connect", f"tcp/{link.address_of(server)}:7447")
        link.cut()
        link.heal()

A machine is a process that holds a network namespace, a host name and a /dev/shm of its own; its programs share the disk with
the others, but not the runtime directory, the asset cache or any address. A `link` relays packets in user space (see relay.py:
the kernel may lack netem); a `cable` is a veth pair, as fast as the kernel. All that is here ends with the processes that hold
it, and those end when the pipe to their input does: nothing is left behind, however the tests end.

Delays are of one way: the round trip is twice as long.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from tests.process.conftest import Command

ROOT = Path(__file__).parents[2]
PORT = 7447
_HOLD = """
mount -t tmpfs elys /dev/shm && hostname "$1" && ip link set lo up && echo held || exit 1
cat >/dev/null  # until whoever holds it is gone, be it that he was killed: then nothing may stay behind
mine=$(readlink /proc/$$/ns/net)
for process in /proc/[0-9]*; do
    number=${process#/proc/}
    [ "$(readlink "$process/ns/net")" = "$mine" ] && [ "$number" != $$ ] && kill -9 "$number"
done
exit 0
"""


class LaboratoryError(Exception):
    """There can be no laboratory here; says why."""


def why_impossible() -> str:
    """Why there can be no laboratory on this machine; "" if there can."""
    for tool in ("unshare", "nsenter", "ip", "mount", "hostname"):
        if shutil.which(tool) is None:
            return f"the program {tool} is missing (packages util-linux, iproute2 and hostname)"
    if not os.access("/dev/net/tun", os.R_OK | os.W_OK):
        return "/dev/net/tun cannot be opened: load the module tun, and run the tests as root"
    try:
        with _held("probe"):
            return ""
    except LaboratoryError as error:
        return str(error)


@contextlib.contextmanager
def _held(name: str) -> Iterator[subprocess.Popen[str]]:
    """A process with namespaces of its own, until the end of the block."""
    holder = subprocess.Popen(
        ["unshare", "--net", "--uts", "--mount", "--", "sh", "-c", _HOLD, "sh", name],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Ctrl-C ends the tests, and they end it
    )
    assert holder.stdin is not None and holder.stdout is not None and holder.stderr is not None
    try:
        if holder.stdout.readline().strip() != "held":
            reason = holder.stderr.read().strip()
            raise LaboratoryError(f"no network namespaces can be made here ({reason}): run the tests as root")
        yield holder
    finally:
        holder.stdin.close()
        holder.wait(10)
        holder.stdout.close()
        holder.stderr.close()


class Machine:
    """A machine of the laboratory. `run` waits for a program on it, `start` and `start_program` do not."""

    def __init__(self, name: str, holder: subprocess.Popen[str], folder: Path) -> None:
        self.name = name
        self.folder = folder  # its programs run here
        self.links: list[Link] = []
        self.started: list[Command] = []
        self._holder = holder
        for kind in ("runtime", "cache"):
            (folder / kind).mkdir(parents=True, exist_ok=True)

    @property
    def process(self) -> int:
        """The process whose namespaces are the machine."""
        return self._holder.pid

    @property
    def prefix(self) -> tuple[str, ...]:
        """What stands before a command so that it runs on this machine, in its folder."""
        enter = ("nsenter", f"--target={self.process}", "--net", "--uts", "--mount", "--")
        return (*enter, "env", "-C", str(self.folder))

    @property
    def environment(self) -> dict[str, str]:
        """Of its programs: what others of the real machine have on their disks is not here."""
        hidden = {"DISPLAY", "WAYLAND_DISPLAY", "XDG_RUNTIME_DIR"}
        return {
            **{name: value for name, value in os.environ.items() if name not in hidden},
            "ELYS_RUNTIME_DIR": str(self.folder / "runtime"),
            "ELYS_CACHE_DIR": str(self.folder / "cache"),
            "ELYS_NULL_PLATFORM": "1",
            "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", "")))),
            "PYTHONUNBUFFERED": "1",
            "COLUMNS": "200",
        }

    @property
    def address(self) -> str:
        """Where others reach it: its address on the first of its links."""
        if not self.links:
            raise LaboratoryError(f"nothing is linked to {self.name}")
        return self.links[0].address_of(self)

    def run(self, words: Sequence[str | Path], *, seconds: float = 60.0) -> str:
        """Runs a program to its end and returns what it printed; CalledProcessError with what it said if it fails."""
        done = subprocess.run(
            [*self.prefix, *map(str, words)],
            env=self.environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=seconds,
            check=False,  # its words make a better error
        )
        if done.returncode:
            raise subprocess.CalledProcessError(done.returncode, list(words), done.stdout, done.stderr)
        return done.stdout

    def run_program(self, program: Path, *words: str | Path, seconds: float = 60.0) -> str:
        """Runs a Python program to its end and returns what it printed."""
        return self.run([sys.executable, program, *words], seconds=seconds)

    def start(self, *words: str | Path, **variables: str) -> Command:
        """Starts `elys WORDS...`."""
        return self._started(tuple(map(str, words)), ("-m", "elys"), variables)

    def start_program(self, program: Path, *words: str | Path, **variables: str) -> Command:
        """Starts a Python program; lines can be sent to its input with `Command.tell`."""
        return self._started(tuple(map(str, words)), (str(program),), variables)

    def _started(self, words: tuple[str, ...], program: tuple[str, ...], variables: dict[str, str]) -> Command:
        prefix = (*self.prefix, sys.executable, *program)
        environment = {**self.environment, **variables}
        command = Command(words, environment, self.folder, prefix=prefix, hears=program[0] != "-m")
        self.started.append(command)
        return command

    def end(self) -> None:
        """Ends its programs, the newest first."""
        for command in reversed(self.started):
            command.end()


@dataclass(frozen=True, slots=True)
class Passed:
    """What went one way through a link so far."""

    packets: int  # that were sent into it
    bytes: int  # that came out
    lost: int  # by chance, or because it was cut
    overflowed: int  # because the queue before the rate was full
    waiting: int  # under way


class Link:
    """A link between two machines; each direction has the same settings unless `change` is told otherwise."""

    def __init__(self, ends: tuple[Machine, Machine], number: int) -> None:
        self.ends = ends
        self._addresses = tuple(f"10.77.{number}.{place}" for place in (1, 2))
        for machine in ends:
            machine.links.append(self)

    def address_of(self, machine: Machine) -> str:
        """The address of one of its ends."""
        return self._addresses[self.ends.index(machine)]

    def cut(self) -> None:
        """Nothing passes any more, and nobody is told."""
        raise NotImplementedError

    def heal(self) -> None:
        """All passes again."""
        raise NotImplementedError

    def close(self) -> None:
        """Takes it away."""


class Cable(Link):
    """A veth pair: nothing but the kernel between two machines."""

    def __init__(self, ends: tuple[Machine, Machine], number: int) -> None:
        super().__init__(ends, number)
        self._device = f"cable{number}"
        one, other = ends
        _configure("ip", "link", "add", self._device, "netns", str(one.process), "type", "veth",
                   "peer", "name", self._device, "netns", str(other.process))  # fmt: skip
        for machine, address in zip(ends, self._addresses, strict=True):
            machine.run(["ip", "address", "add", f"{address}/30", "dev", self._device])
            machine.run(["ip", "link", "set", self._device, "up"])

    def cut(self) -> None:
        # A device that is down would tell its programs so. Who sends to a hardware address that nobody has hears nothing.
        self._set_neighbours("replace", "lladdr", "02:00:00:00:00:00", "nud", "permanent")

    def heal(self) -> None:
        self._set_neighbours("delete")

    def _set_neighbours(self, verb: str, *words: str) -> None:
        for machine, address in zip(self.ends, reversed(self._addresses), strict=True):
            machine.run(["ip", "neighbour", verb, address, "dev", self._device, *words])


class RelayedLink(Link):
    """A link whose packets a process relays: slow, lossy, narrow or cut as it is told while it runs."""

    def __init__(self, ends: tuple[Machine, Machine], number: int) -> None:
        super().__init__(ends, number)
        device = f"link{number}"
        places = [word for machine in ends for word in (str(machine.process), device)]
        self._relay = subprocess.Popen(
            [sys.executable, "-I", str(Path(__file__).with_name("relay.py")), *places],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self._answer()
        for machine, mine, other in zip(ends, self._addresses, reversed(self._addresses), strict=True):
            machine.run(["ip", "address", "add", mine, "peer", other, "dev", device])
            machine.run(["ip", "link", "set", device, "up", "txqueuelen", "10000"])

    @property
    def process(self) -> int:
        """The process that relays."""
        return self._relay.pid

    def change(self, *, towards: Machine | None = None, **settings: float) -> None:
        """Sets `delay` [s one way], `jitter` [s], `loss` [share], `rate` [bytes/s; 0: any], `queue` [bytes], `is_cut`.

        Without `towards` of both directions.
        """
        settings_of = [settings if towards in (None, target) else {} for target in reversed(self.ends)]
        self._tell(settings_of)

    def cut(self) -> None:
        self.change(is_cut=True)

    def heal(self) -> None:
        self.change(is_cut=False)

    def passed(self, towards: Machine) -> Passed:
        """What went towards one of its ends."""
        counts = self._tell([{}, {}])
        return Passed(**counts[1 - self.ends.index(towards)])

    def close(self) -> None:
        assert self._relay.stdin is not None and self._relay.stdout is not None
        self._relay.stdin.close()
        self._relay.wait(10)
        self._relay.stdout.close()

    def _tell(self, settings: list[dict[str, Any]]) -> list[dict[str, int]]:
        assert self._relay.stdin is not None
        self._relay.stdin.write(json.dumps(settings) + "\n")
        self._relay.stdin.flush()
        return self._answer()

    def _answer(self) -> list[dict[str, int]]:
        assert self._relay.stdout is not None
        line = self._relay.stdout.readline()
        if not line:
            raise LaboratoryError(f"the relay between {' and '.join(m.name for m in self.ends)} has ended")
        return list(json.loads(line))


class Laboratory:
    """Machines and what links them, until the end of the `with` block."""

    def __init__(self, folder: Path, *, congestion: str = "reno") -> None:
        """`folder` is where the machines have theirs; `congestion` how their TCP meets loss.

        Most systems have cubic. A namespace may choose reno alone, which does no better over bad lines; "" is this machine's.
        """
        self._folder = folder
        self._congestion = congestion
        self._machines: list[Machine] = []
        self.links: list[Link] = []
        self._open = contextlib.ExitStack()

    def __enter__(self) -> Laboratory:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._open:
            for machine in reversed(self._machines):
                machine.end()
            for link in self.links:
                link.close()

    @property
    def processes(self) -> list[int]:
        """The processes that hold all this."""
        relays = [link.process for link in self.links if isinstance(link, RelayedLink)]
        return [*(machine.process for machine in self._machines), *relays]

    def machine(self, name: str) -> Machine:
        """A new machine, linked to nothing."""
        made = Machine(name, self._open.enter_context(_held(name)), self._folder / name)
        made.run(["sh", "-c", "echo 1 > /proc/sys/net/ipv6/conf/all/disable_ipv6 || true"])  # it asks for neighbours
        if self._congestion:
            made.run(["sh", "-c", f"echo {self._congestion} > /proc/sys/net/ipv4/tcp_congestion_control"])
        self._machines.append(made)
        return made

    def machines(self, *names: str) -> tuple[Machine, ...]:
        """New machines, linked to nothing."""
        return tuple(map(self.machine, names))

    def link(self, one: Machine, other: Machine, **settings: float) -> RelayedLink:
        """Links two machines over a line with these `settings` (see `RelayedLink.change`)."""
        made = RelayedLink((one, other), len(self.links))
        self.links.append(made)
        made.change(**settings)
        return made

    def cable(self, one: Machine, other: Machine) -> Cable:
        """Links two machines as fast as the kernel can."""
        made = Cable((one, other), len(self.links))
        self.links.append(made)
        return made


def _configure(*words: str) -> None:
    subprocess.run(words, check=True, capture_output=True, text=True)
