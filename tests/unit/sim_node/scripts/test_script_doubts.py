"""What in a script is hardly meant is said once, and refuses nothing; what ELYS itself brings is beyond doubt."""

from __future__ import annotations

import logging
import re
import textwrap
from pathlib import Path

import pytest

import elys.pieces
import elys.samples.scripts
from elys.common.assets.scripts import read_script
from elys.common.assets.store import AssetStore
from elys.sim_node.scripts.behaviour import HOOKS
from elys.sim_node.scripts.doubts import _DEEDS
from elys.sim_node.scripts.library import ScriptLibrary
from tests.unit.sim_node.scripts.conftest import HEAD, Playground

DOCS = Path(__file__).parents[4] / "docs"
SHIPPED = [
    path
    for folder in (*elys.pieces.__path__, *elys.samples.scripts.__path__)
    for path in sorted(Path(folder).rglob("*.py"))
]


@pytest.fixture
def doubts(play: Playground, caplog: pytest.LogCaptureFixture):
    """Loads a script and gives what was said of it, "LINE: sentence"."""
    library = ScriptLibrary(play.assets)

    def said(text: str, name: str = "a.py") -> list[str]:
        (play.folder / name).write_text(textwrap.dedent(text))
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            library.load(play.source(name, "A"))
        return [message.removeprefix(f"{play.folder / name}:") for message in caplog.messages]

    return said


def test_what_nobody_awaits_is_said(doubts) -> None:
    assert doubts(
        """\
        import elys.script as es
        from elys.script import *
        from elys.script import seconds as wait
        class Base(Behaviour):
            async def start(self): pass
            async def other(self, far=False): pass
        async def blink(one): pass
        def all_at(place):
            ticks(3)
        class A(Base):
            def start(self):
                self.other()
                super().start()
                blink(self)
                self.entity.animation_end()
                if self.world:
                    self.part.move_to((0, 1, 0), duration=0.5)
            async def deep(self):
                wait(1.0)
                es.event("door")
                until(lambda: self.other() and self.world.tick > 100 and self.entity.position.y > 3)
                all_of(self.other(), blink(self))
        """
    ) == [
        "9: ticks(3) waits for nothing by itself: await it in an async function",
        "12: self.other() begins nothing by itself: await it in an async function, or self.begin(self.other())",
        "13: super().start() begins nothing by itself: await it in an async function, or self.begin(super().start())",
        "14: blink(self) begins nothing by itself: await it in an async function, or self.begin(blink(self))",
        "15: self.entity.animation_end() begins nothing by itself: await it in an async function, or "
        "self.begin(self.entity.animation_end())",
        "17: self.part.move_to((0, 1, 0), duration=0.5) begins nothing by itself: await it in an async function, or "
        "self.begin(self.part.move_to((0, 1, 0), duration=0.5))",
        "19: wait(1.0) waits for nothing by itself: await it in an async function",
        '20: es.event("door") waits for nothing by itself: await it in an async function',
        "21: until(...) waits for nothing by itself: await it in an async function",
        "22: all_of(self.other(), blink(self)) waits for nothing by itself: await it in an async function",
    ]
    assert sorted(_DEEDS) == ["animation_end", "move_to", "rotate_to", "tween"]


def test_what_is_awaited_begun_or_something_else_is_not_doubted(doubts) -> None:
    assert not doubts(
        """\
        from elys.script import *
        class Cart:
            def move_to(self, place): pass
        class A(Behaviour):
            async def other(self): pass
            def plain(self): pass
            def start(self):
                self.begin(self.other())
                self.every(1.0, self.other)
                self.plain()
                Cart().move_to(3)
                waiting = self.other()
                self.begin(waiting)
                self.entity.play("walk")
            async def run(self):
                await self.other()
                found = await first_of(self.other(), ticks(2))
                seconds = print
                seconds(3)
            def on_event(self, event):
                event(3)
        """
    )


def test_long_files_are_looked_through(doubts) -> None:
    chain = "".join(f"    elif self == {number}: pass\n" for number in range(900))
    text = f"from elys.script import *\ndef f(self):\n    if self: pass\n{chain}    else: ticks(1)\n"
    text += f"    return {'+'.join('1' * 900)}\n"
    assert doubts(text + "class A(Behaviour): pass\n") == [
        "904: ticks(1) waits for nothing by itself: await it in an async function"
    ]


def test_what_is_nearly_a_hook_is_said(doubts) -> None:
    hooks = ", ".join(HOOKS)
    assert doubts(
        """\
        from elys.script import *
        class A(Behaviour):
            def on_triger_enter(self, other): pass
            async def updat(self, dt): pass
            def fixedupdate(self, dt): pass
            def OnTriggerExit(self, other): pass
            def on_collision(self, other): pass
            def on_start(self): pass
            def udpate(self, dt): pass
            def on_opened(self): pass
        """
    ) == [
        "3: on_triger_enter is called by nobody; did you mean on_trigger_enter?",
        "4: updat is called by nobody; did you mean update?",
        "5: fixedupdate is called by nobody; did you mean fixed_update?",
        "6: OnTriggerExit is called by nobody; did you mean on_trigger_exit?",
        "7: on_collision is called by nobody; did you mean on_contact?",
        "8: on_start is called by nobody; did you mean start?",
        "9: udpate is called by nobody; did you mean update?",
        f"10: on_opened is called by nobody in its files, and is no hook: hooks are {hooks}",
    ]


def test_helpers_are_no_hooks(doubts) -> None:
    assert not doubts(
        """\
        from elys.script import *
        class Base(Behaviour):
            def opened(self): self.on_opened()
            def on_opened(self): pass
        class A(Base):
            def on_opened(self): pass
            def on_told(self): pass
            def on_late(self): pass
            def start(self): self.every(1.0, self.on_told), getattr(self, "on_late")()
            def updated(self, dt): pass
            def updates(self, dt): pass
            def restart(self): pass
            def state(self): pass
            def update_all(self, dt): pass
            def contact(self): pass
            def input(self, player): pass
            def strat(self, way): pass
            def _on_input(self): pass
            @property
            def on_fire(self): return True
        """
    )


def test_a_doubt_is_said_once_of_each_version_of_a_file(doubts, play: Playground) -> None:
    wrong = "from elys.script import *\nclass Base(Behaviour):\n    def on_colision(self): pass\n"
    (play.folder / "base.py").write_text(wrong)
    use = "from base import Base\nclass A(Base): pass\n"
    assert len(doubts(use)) == 1
    assert doubts(use, "b.py") == [] and doubts(use + "# more\n") == []
    (play.folder / "base.py").write_text(wrong + "# more\n")
    assert len(doubts(use)) == 1


def test_nothing_is_said_of_what_elys_brings(caplog: pytest.LogCaptureFixture) -> None:
    assets = AssetStore()
    library = ScriptLibrary(assets)
    loaded = set()
    with caplog.at_level(logging.WARNING):
        for path in SHIPPED:
            for name in re.findall(r"^class (\w+)\((?!NamedTuple)", path.read_text("utf-8"), re.MULTILINE):
                library.load(read_script(path, name, assets))
                loaded.add(name)
    assert caplog.messages == []
    assert {"Door", "Conveyor", "Race", "Menu", "Carillon"} <= loaded


@pytest.mark.parametrize("page", ["scripts.md", "characters.md"])
def test_nothing_is_said_of_the_examples_of_the_pages(page: str, play: Playground, doubts) -> None:
    blocks = re.findall(r"(?:^(?: {4}.*)?\n)+", (DOCS / page).read_text("utf-8"), re.MULTILINE)
    examples = [block for block in blocks if "(Behaviour):" in block]
    assert examples
    for number, example in enumerate(examples):
        text = HEAD + re.sub(r"class \w+\(Behaviour\)", "class A(Behaviour)", textwrap.dedent(example))
        assert doubts(text, f"example_{number}.py") == []
