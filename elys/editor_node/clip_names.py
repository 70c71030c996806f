"""What the clips of a scene are called: their assets are with the host, which is asked for them as they are looked at.

declaration (names=Naming.MIX) ──┐
Animation.clips ──ASSET──> names ┴──> NameOffer ──> the field's widget
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

from elys.bus.asset_service import AssetClient, cache_directory
from elys.bus.session import Session
from elys.common.assets.clip import clip_names
from elys.common.assets.store import AssetStore, is_reference
from elys.common.components import Animation, AnimationBlend, Component, FieldDeclaration, Naming
from elys.common.components.animation_texts import markers_with, mix_with
from elys.common.errors import ComponentError, ElysError
from elys.editor_node.field_values import NameOffer
from elys.editor_node.scene_mirror import EditorScene

ASK_AGAIN: Final = 2.0  # [s] until clips are asked for again that could not be had


class ClipNames:
    """Names of clips by the reference of their asset; content never changes, so each is asked for once."""

    def __init__(
        self,
        scene: EditorScene,
        session: Session,
        *,
        on_change: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`on_change` is called when others are known."""
        self._scene = scene
        self._session = session
        self._on_change = on_change
        self._clock = clock
        self._known: dict[str, tuple[str, ...]] = {}
        self._asked: dict[str, float] = {}  # when, last
        self._assets: tuple[tuple[object, ...], tuple[str, ...]] = (
            (),
            (),
        )  # of some entities, and what they were found in
        session.on_link(lambda connected: self._asked.clear())

    def offer(self, declared: FieldDeclaration, now: Component, entities: Sequence[int]) -> NameOffer | None:
        """What a field of entities may name, if it names clips: those that all of them have. None while they are not known.

        `now` is the component as it stands beside the field, of the entity selected last.
        """
        if declared.names is None:
            return None
        names = self.common(entities)
        if not names:
            return None
        match declared.names:
            case Naming.CLIP:
                return NameOffer(names)
            case Naming.MIX:
                by_value = isinstance(now, AnimationBlend) and now.by == "value"
                return NameOffer(names, partial(_longer, names, partial(mix_with, by_value=by_value)))
            case Naming.MARKERS:
                return NameOffer(names, partial(_longer, names, markers_with))

    def common(self, entities: Sequence[int]) -> tuple[str, ...]:
        """The names that the Animations of all entities have, in the order of the last one's; none while one is not known."""
        found: list[str] | None = None
        for asset in self._assets_of(entities):
            names = self.of(asset)
            if not names:
                return ()
            found = list(names) if found is None else [name for name in found if name in names]
        return tuple(found or ())

    def of(self, reference: str) -> tuple[str, ...]:
        """The names of the clips in an asset; none while it is not known, or where it cannot be had."""
        known, now = self._known.get(reference), self._clock()
        is_due = reference not in self._asked or now - self._asked[reference] >= ASK_AGAIN
        if known is None and is_due and is_reference(reference):
            self._asked[reference] = now
            self._session.start(self._ask(reference))
        return known or ()

    def _assets_of(self, entities: Sequence[int]) -> tuple[str, ...]:
        """What the Animations name, each once, the last entity's first; "" where there is none."""
        mirror = self._scene.mirror
        key = (tuple(entities), mirror.epoch, mirror.sequence)  # of thousands not in each frame
        if key != self._assets[0]:
            found: dict[str, None] = {}
            for entity in reversed(entities):
                known = mirror.entities.get(entity)
                animation = known.components.get("Animation") if known is not None else None
                found[animation.clips if isinstance(animation, Animation) else ""] = None
            self._assets = (key, tuple(found))
        return self._assets[1]

    async def _ask(self, reference: str) -> None:
        try:
            cache = await asyncio.to_thread(AssetStore, cache_directory())
            data = await AssetClient(self._session, cache).fetch(reference, kind="clips")
            names = await asyncio.to_thread(clip_names, data)
        except ElysError:
            return  # the simulation says so too where somebody plays it; names can be typed all the same
        self._known[reference] = tuple(name for name in names if name)  # an empty text means none
        self._on_change()


def _longer(names: Sequence[str], added: Callable[[str, str], str], text: str) -> dict[str, str]:
    """What `added` makes of a text with each name that can be added."""
    found = {}
    for name in names:
        with contextlib.suppress(ComponentError):  # it stands there already, or cannot
            found[name] = added(text, name)
    return found
