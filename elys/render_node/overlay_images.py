"""Images of overlays on the card: decoded off the drawing thread, and drawn when they have come."""

from __future__ import annotations

import logging
from typing import Final

from elys.common.assets.images import placeholder_image
from elys.common.assets.texture import split_texture
from elys.common.errors import DisplayError
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.gpu import TEXTURE_UNITS, Context, Texture
from elys.render_node.images import decode_image, shrunk

KEPT: Final = 64  # images that are not shown any more stay, up to so many
_log = logging.getLogger(__name__)


class OverlayImages:
    """Images by reference, those used longest ago first. What cannot be had is a checker."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._assets: DrawableAssets | None = None
        self._textures: dict[str, Texture] = {}
        self._checker: Texture | None = None

    def begin(self, assets: DrawableAssets) -> None:
        """Takes from these assets from now on what is not here."""
        self._assets = assets
        while len(self._textures) > KEPT:
            del self._textures[next(iter(self._textures))]

    def size(self, reference: str) -> tuple[int, int] | None:
        """Width and height [pixels]; None for none, and while it is on its way."""
        texture = self._texture(split_texture(reference)[0])
        return texture.size if texture is not None else None

    def use(self, reference: str) -> None:
        """Shows an image whose size is known to the shader."""
        texture = self._texture(split_texture(reference)[0])
        if texture is not None:
            texture.use(TEXTURE_UNITS["overlay_image"])

    def _texture(self, reference: str) -> Texture | None:
        if not reference or self._assets is None:
            return None
        texture = self._textures.pop(reference, None)
        if texture is None:
            texture = self._made(reference, self._assets)
        if texture is not None and texture is not self._checker:
            self._textures[reference] = texture  # the last one used stands last
        return texture

    def _made(self, reference: str, assets: DrawableAssets) -> Texture | None:
        pixels = assets.take_image(reference)
        if pixels is None:
            return self._placeholder() if reference in assets.failed else None
        largest = self._context.max_size
        if max(pixels.shape[:2]) > largest:
            size = pixels.shape[1::-1]
            pixels = shrunk(pixels, largest, is_color=True)
            _log.warning(
                "%s, of an overlay, of %d x %d pixels is drawn with %d x %d: this card takes edges up to %d",
                assets.told(reference),
                *size,
                *pixels.shape[1::-1],
                largest,
            )
        try:
            texture = Texture(self._context, (pixels.shape[1], pixels.shape[0]), "rgba8", data=pixels, mipmaps=True)
        except DisplayError as error:
            assets.give_up(reference, str(error))
            return self._placeholder()
        return texture

    def _placeholder(self) -> Texture:
        if self._checker is None:
            pixels = decode_image(placeholder_image())
            self._checker = Texture(self._context, (pixels.shape[1], pixels.shape[0]), "rgba8", data=pixels)
        return self._checker
