"""What a simulation said of itself, in recordings made beside it, and whether what others say they saw is that."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from elys.bus.mirror import SceneMirror
from elys.bus.recording import Recording
from tests.network.programs.watcher import frame_sum, scene_sum
from tests.process.conftest import Command

SAID = re.compile(r"(\d+\.\d+) (joined|scene|link|state|mirror|reply|failed) (.*)")


@dataclass(slots=True)
class Truth:
    """Of each run of a host by its epoch: states by tick, scenes by delta."""

    hashes: dict[tuple[int, int], str] = field(default_factory=dict)
    states: dict[tuple[int, int], int] = field(default_factory=dict)
    scenes: dict[tuple[int, int], int] = field(default_factory=dict)

    def add(self, path: Path) -> None:
        """Takes what a recording says."""
        with Recording(path) as recording:
            mirror: SceneMirror | None = None
            for position in range(len(recording)):
                frame = recording.frame(position)
                place = (frame.epoch, frame.tick)
                self.hashes[place] = f"{frame.state_hash:016x}"
                self.states[place] = frame_sum(frame)
                if mirror is None:
                    mirror = recording.mirror_at(position)
                else:
                    recording.advance(mirror, position)
                known = (mirror.epoch, mirror.sequence)
                if known not in self.scenes:
                    self.scenes[known] = scene_sum(mirror)


@dataclass(slots=True)
class Account:
    """What a watcher said it saw, in its order."""

    links: list[tuple[float, bool]] = field(default_factory=list)
    states: list[tuple[float, int, int, str, int, float]] = field(
        default_factory=list
    )  # when, epoch, tick, hash, sum, age
    scenes: list[tuple[float, int, int, int]] = field(default_factory=list)  # when, epoch, sequence, sum

    @classmethod
    def of(cls, watcher: Command, *, since: int = 0) -> Account:
        """What it said from a line on."""
        account = cls()
        for line in list(watcher.lines)[since:]:
            if (found := SAID.fullmatch(line)) is None:
                continue
            when, words = float(found[1]), found[3].split()
            match found[2]:
                case "link":
                    account.links.append((when, words[0] == "1"))
                case "state":
                    epoch, tick, state_hash, total, age = words
                    account.states.append((when, int(epoch), int(tick), state_hash, int(total), float(age)))
                case "mirror":
                    account.scenes.append((when, *map(int, words)))  # type: ignore[arg-type]
        return account

    def compared(self, truth: Truth) -> tuple[int, int]:
        """How many states and scenes were compared; fails at one that the simulation never had, or that came back."""
        compared = [0, 0]
        newest = (0, -1)
        for _, epoch, tick, state_hash, total, _ in self.states:
            assert (epoch, tick) >= newest, f"tick {tick} of {epoch} was shown after {newest}"
            newest = (epoch, tick)
            if (epoch, tick) in truth.states:
                assert state_hash == truth.hashes[epoch, tick], f"tick {tick} of {epoch} has another hash"
                assert total == truth.states[epoch, tick], f"tick {tick} of {epoch} was shown otherwise than it was"
                compared[0] += 1
        for _, epoch, sequence, total in self.scenes:
            if (epoch, sequence) in truth.scenes:
                assert total == truth.scenes[epoch, sequence], f"the scene at {sequence} of {epoch} is another"
                compared[1] += 1
        return compared[0], compared[1]
