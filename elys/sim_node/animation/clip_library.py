"""The clips that assets hold, made ready to be sampled, each once."""

from __future__ import annotations

from elys.common.assets.clip import Clip, decode_clips
from elys.common.assets.clip_sampling import ClipSampler
from elys.common.assets.store import AssetStore
from elys.common.errors import AssetError

ClipKey = tuple[str, str]  # reference of the clips, name of one


class ClipLibrary:
    """Clips of one store."""

    def __init__(self, assets: AssetStore) -> None:
        self._assets = assets
        self._clips: dict[str, dict[str, Clip] | str] = {}  # by reference; a text says why there are none
        self._samplers: dict[ClipKey, ClipSampler] = {}

    def names(self, reference: str) -> list[str]:
        """The names of clips, in their order; none where they cannot be had."""
        clips = self._clips_of(reference)
        return [] if isinstance(clips, str) else list(clips)

    def find(self, reference: str, name: str) -> ClipKey | str:
        """The key of a clip, "" for the first; or a sentence that says why there is none."""
        clips = self._clips_of(reference)
        if isinstance(clips, str):
            return clips
        if name in clips or (not name and clips):
            return (reference, name or next(iter(clips)))
        return f"there is no clip '{name}' among its clips; there are {shown(list(clips))}"

    def sampler(self, key: ClipKey) -> ClipSampler:
        """The sampler of a clip that `find` found; AssetError where its asset cannot be had."""
        if key not in self._samplers:
            clips = self._clips_of(key[0])
            if isinstance(clips, str) or key[1] not in clips:
                raise AssetError(clips if isinstance(clips, str) else f"there is no clip '{key[1]}'")
            self._samplers[key] = ClipSampler(clips[key[1]])
        return self._samplers[key]

    def _clips_of(self, reference: str) -> dict[str, Clip] | str:
        if reference not in self._clips:
            try:
                self._clips[reference] = {clip.name: clip for clip in decode_clips(self._assets.get(reference))}
            except AssetError as error:
                self._clips[reference] = str(error)
        return self._clips[reference]


def shown(names: list[str]) -> str:
    """Names as they stand in a sentence."""
    return ", ".join(f"'{name}'" for name in names[:12]) or "none"
