"""Where a picture is drawn before it is one."""

from __future__ import annotations

from elys.render_node.gpu import Context, Format, Framebuffer
from elys.render_node.quality import Quality


class Targets:
    """The framebuffers of pictures of one size."""

    def __init__(self, context: Context, width: int, height: int, quality: Quality, *, to_screen: bool) -> None:
        samples = min(quality.samples, context.max_samples)
        form: Format = "rgba8" if to_screen else quality.light_form
        self.light = Framebuffer(context, width, height, (form,), depth=not samples)
        self.drawn = (
            Framebuffer(context, width, height, (form,), depth=True, samples=samples) if samples else self.light
        )
        self.picture = self.light if to_screen else Framebuffer(context, width, height, ("rgba8",), smooth=False)

    def resolve(self) -> None:
        """Averages the samples of what was drawn."""
        if self.drawn is not self.light:
            self.drawn.resolve_into(self.light)
