"""Hands in the inspector: what a person does there again and again."""

from __future__ import annotations

import pytest

from elys.editor_node.events import MouseButton, MousePressed, MouseReleased
from elys.editor_node.keys import Key
from tests.unit.editor_node.person import CTRL


class Hand:
    """What hands do in the inspector again and again."""

    def __init__(self, person) -> None:
        self.person = person
        self.model = person.editor.model
        self.entities = person.stage.host.mirror.entities
        self.landmarks = person.editor.ui.landmarks

    def value(self, name: str, component: str, field: str):
        return getattr(self.entities[self.person.stage.named(name)].components[component], field)

    async def settle(self) -> None:
        await self.model.history.settle()
        await self.person.frames(2)

    async def enter(self, field: str, text: str) -> None:
        """Types into a number and presses Enter."""
        await self.person.click(f"inspector/{field}", times=2)
        await self.person.press(Key.A, CTRL)
        await self.person.type(text)
        await self.person.press(Key.ENTER)
        await self.settle()

    async def shown(self) -> set[str]:
        """The landmarks that are drawn now."""
        self.landmarks.rectangles.clear()
        await self.person.frames(2)
        return set(self.landmarks.rectangles)

    async def fold(self, *components: str) -> None:
        for name in components:
            await self.person.click(f"inspector/{name}")
            await self.person.frames(2)

    async def right_click(self, name: str) -> None:
        await self.person.point(name)
        await self.person.do(MousePressed(MouseButton.RIGHT), MouseReleased(MouseButton.RIGHT))
        await self.person.frames(3)

    async def carry(self, source: str, target: str) -> None:
        """Drags one widget onto another."""
        await self.person.until(lambda: target in self.landmarks.rectangles)
        start, end = self.landmarks.center(source), self.landmarks.center(target)
        await self.person.drag(source, end[0] - start[0], end[1] - start[1])
        await self.settle()


@pytest.fixture
def by_hand(at_the_editor):
    """Runs `await scenario(hand)` at an editor, with one entity selected by a click."""

    def play(scenario, select: str = "Crate", records=None) -> None:
        async def with_person(person):
            hand = Hand(person)
            if select:
                await person.click(f"hierarchy/{select}")
                await person.frames(2)
            await scenario(hand)

        at_the_editor(with_person, records)

    return play
