"""Processes that die and lines that break: the session goes on, and nothing wrong or old is ever shown."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.network.laboratory import PORT, Laboratory, Machine, RelayedLink
from tests.network.test_far_away import WATCHER, simulating
from tests.network.truth import Account, Truth
from tests.process.conftest import Command, wait_until

pytestmark = pytest.mark.process
KILLS, SOAK_KILLS = 5, 300
# [s] until death is seen, and until all is right after a heal. `make soak` has the machine to itself.
SEEN, SEEN_UNDER_LOAD = 1.0, 4.0


def states_of(watcher: Command, since: int) -> int:
    return sum(" state " in line for line in list(watcher.lines)[since:])


def wait_for_states(watcher: Command, count: int = 5, *, epoch: int | None = None, seconds: float = 90.0) -> None:
    """Waits until it has shown so many more states, of a run of the host's."""
    since, what = len(watcher.lines), " state " if epoch is None else f" state {epoch} "
    wait_until(lambda: sum(what in line for line in list(watcher.lines)[since:]) >= count, seconds=seconds)


def test_an_outage_is_seen_and_all_is_right_again_soon_after(lab: Laboratory, soak: bool) -> None:
    limit = SEEN if soak else SEEN_UNDER_LOAD
    server, laptop = lab.machines("server", "laptop")
    link = lab.link(server, laptop, delay=0.01)
    simulating(server, "stack")
    watcher = laptop.start_program(WATCHER, f"tcp/{link.address_of(server)}:{PORT}")
    wait_for_states(watcher, 30)
    for outage in (3.0, *((0.5, 1.3, 3.3, 3.6, 8.0) if soak else ())):
        since = len(watcher.lines)
        link.cut()
        cut = time.monotonic()
        if outage > limit:
            seen = float(watcher.wait_for(r"^(\S+) link 0", seconds=20)[1]) if not watcher_saw(watcher, since) else 0.0
        time.sleep(max(0.0, cut + outage - time.monotonic()))  # the length of the outage is what is tested
        link.heal()
        healed = time.monotonic()
        wait_for_states(watcher, 5)
        account = Account.of(watcher, since=since)
        if outage > limit:
            seen = min(when for when, connected in account.links if not connected)
            assert seen - cut < limit
        right = min(when for when, *_ in account.states if when > healed)
        assert right - healed < limit
        print(f"outage of {outage} s: right again after {right - healed:.2f} s", end="; ")


def watcher_saw(watcher: Command, since: int) -> bool:
    return any(" link 0" in line for line in list(watcher.lines)[since:])


def test_a_host_replaced_while_the_line_was_cut_is_another_run(lab: Laboratory) -> None:
    server, laptop = lab.machines("server", "laptop")
    link = lab.link(server, laptop, delay=0.01)
    first = simulating(server, "stack", "--record", "one.mcap")
    watcher = laptop.start_program(WATCHER, f"tcp/{link.address_of(server)}:{PORT}")
    wait_for_states(watcher, 10)
    link.cut()
    first.kill()
    second = simulating(server, "stack", "--record", "two.mcap")
    link.heal()
    wait_until(lambda: len({epoch for _, epoch, *_ in Account.of(watcher).states}) == 2, seconds=60)
    wait_for_states(watcher, 30)
    watcher.tell("rename Ground Floor")
    watcher.wait_for("reply rename accepted")
    second.process.terminate()
    assert second.wait() == 0
    truth = Truth()
    for name in ("one.mcap", "two.mcap"):
        wait_until(lambda name=name: is_whole(server.folder / name))  # its recorder outlives the killed one
        truth.add(server.folder / name)
    states, scenes = Account.of(watcher).compared(truth)
    assert states > 30 and scenes > 0


def is_whole(path: Path) -> bool:
    return path.stat().st_size > 1000 and path.read_bytes()[-8:] == b"\x89MCAP0\r\n"


def test_several_endpoints_are_tried_in_turn(lab: Laboratory) -> None:
    server, laptop = lab.machines("server", "laptop")
    one, other = lab.link(server, laptop), lab.link(server, laptop, delay=0.01)
    simulating(server, "stack")
    one.cut()
    endpoints = ",".join(f"tcp/{link.address_of(server)}:{PORT}" for link in (one, other))
    watcher = laptop.start_program(WATCHER, endpoints)
    wait_for_states(watcher)
    assert other.passed(laptop).bytes > one.passed(laptop).bytes
    before = one.passed(laptop).bytes
    one.heal()
    other.cut()
    wait_for_states(watcher)
    assert one.passed(laptop).bytes > before + 2_000  # a few states, and what came before them


def test_two_of_one_name_are_told_apart(lab: Laboratory) -> None:
    (server,) = lab.machines("server")
    simulating(server, "stack")
    second = server.start("run", "stack", "--headless")
    assert (
        second.wait_for("a session called Stack-of-10 runs already at .*: this one is called (.*)")[1]
        == "Stack-of-10-2"
    )
    second.wait_for("simulating")
    refused = server.start("run", "stack", "--headless", "--name", "Stack-of-10")
    assert refused.wait() == 1
    assert "a session called Stack-of-10 runs already" in refused.output and "Traceback" not in refused.output


def rename(viewer: Command) -> None:
    """An edit that changes nothing, until it is accepted: one that was under way when the line broke is told again."""
    since, tellings = len(viewer.lines), 0

    def is_accepted() -> bool:
        nonlocal tellings
        said = [line for line in list(viewer.lines)[since:] if " state " not in line]
        replies = [line for line in said if " reply rename " in line]
        refused = [line for line in replies if "accepted" not in line]
        if len(replies) > len(refused):
            assert len(refused) <= sum(" link 0" in line for line in said), said  # no other reason is one
            return True
        if tellings == len(refused):  # that the line broke may be told a moment after what broke with it
            tellings += 1
            viewer.tell("rename Ground Ground")
        return False

    wait_until(is_accepted, seconds=60)


class Campaign:
    """A session over bad lines, whose processes are killed and whose lines are cut; and what proves that it went well."""

    def __init__(self, lab: Laboratory) -> None:
        self.server, self.laptop, self.archive = lab.machines("server", "laptop", "archive")
        self.links = [lab.link(self.server, machine, delay=0.01, loss=0.005) for machine in (self.laptop, self.archive)]
        self.near, self.far = (f"tcp/{link.address_of(self.server)}:{PORT}" for link in self.links)
        self.truth = Truth()
        self.runs: list[Path] = []
        self.watchers: list[tuple[Command, int]] = []  # and how many of its lines were judged
        self.commands: dict[str, tuple[Machine, tuple[str, ...]]] = {
            "recorder": (self.archive, ("record", "--connect", self.far, "--patience", "90")),
            "editor": (self.laptop, ("node", "editor", "--connect", self.near)),
        }
        self.running = {"simulation": self.simulate(), "viewer": self.watch()}
        for kind in self.commands:
            self.running[kind] = self.start(kind, 0)
        wait_for_states(self.running["viewer"])

    def simulate(self) -> Command:
        name = f"run-{len(self.runs)}.mcap"
        self.runs.append(self.server.folder / name)
        return simulating(self.server, "stack", "--record", name, "--keep", "2")

    def watch(self) -> Command:
        return self.laptop.start_program(WATCHER, self.near)

    def start(self, kind: str, number: int) -> Command:
        machine, words = self.commands[kind]
        return machine.start(*words, *(("-o", f"outside-{number}.mcap") if kind == "recorder" else ()))

    def strike(self, kind: str, number: int, chance: random.Random) -> None:
        """Kills a process and starts it again, or cuts a line for a while."""
        if kind == "line":
            link: RelayedLink = chance.choice(self.links)
            link.cut()
            time.sleep(chance.uniform(0.1, 3.0))  # how long is chance, too
            link.heal()
        else:
            self.running[kind].kill()
            starts: dict[str, Callable[[], Command]] = {"simulation": self.simulate, "viewer": self.watch}
            self.running[kind] = starts.get(kind, lambda: self.start(kind, number))()
        self.go_on()

    def go_on(self) -> None:
        """The session goes on: states come, edits are taken, nobody has ended."""
        viewer = self.running["viewer"]
        wait_for_states(viewer)
        rename(viewer)
        for kind, command in self.running.items():
            assert command.process.poll() is None, f"{kind} ended: {command.output[-2000:]}"

    def judge(self, viewers: list[Command]) -> tuple[int, int]:
        """Ends it, and compares all that was shown with what the simulations recorded."""
        self.running["simulation"].process.terminate()
        self.running["simulation"].wait()
        for path in self.runs:
            wait_until(lambda path=path: is_whole(path))
            self.truth.add(path)
        counts = [Account.of(viewer).compared(self.truth) for viewer in viewers]
        return sum(states for states, _ in counts), sum(scenes for _, scenes in counts)


@pytest.mark.usefixtures("machine_to_itself")
@pytest.mark.timeout(4 * 3600)
def test_random_kills_and_cuts(lab: Laboratory, soak: bool) -> None:
    campaign, chance = Campaign(lab), random.Random(5)
    kinds = ["simulation", "line", "viewer", "recorder", "editor"]
    viewers = [campaign.running["viewer"]]
    for number in range(SOAK_KILLS if soak else KILLS):
        # The first ones are one of each; then it is chance.
        kind = kinds[number] if number < len(kinds) else chance.choice(kinds)
        campaign.strike(kind, number + 1, chance)
        if kind == "viewer":
            viewers.append(campaign.running["viewer"])
    states, scenes = campaign.judge(viewers)
    print(f"{states} states and {scenes} scenes were what the simulation had", end="; ")
    assert states > 50 and scenes > 2
