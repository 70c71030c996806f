"""How much a picture may cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from elys.common.scene import PictureSettings
from elys.render_node.gpu import Context, Format

SAMPLES_AROUND: Final = 512  # of each lobe, where light from around is sampled for each pixel


@dataclass(frozen=True, slots=True, kw_only=True)
class Quality:
    """What a Renderer spends.

    `to_screen` has each pass write the screen's colours at once instead of linear light that is tone-mapped at the end:
    see-through things then blend a little darker.
    """

    samples: int  # per pixel; 0 for one
    single_shadow_tap: bool
    shadow_size: int  # [texels] of an edge of the shadow map
    lamp_shadow_size: int  # the same of the atlas of bulbs and spots; 0: they throw none
    to_screen: bool
    light_form: Format = "rgba16f"  # of linear light
    stand_ins: bool = True  # what a shader should have drawn that is refused is magenta; else nothing is drawn at all

    def writes_screen(self, picture: PictureSettings) -> bool:
        """Whether passes write the screen's colours at once: not where something has to be done to the light of all."""
        return self.to_screen and picture.bloom == 0.0

    def light_defines(self, picture: PictureSettings) -> tuple[str, ...]:
        """What shaders that put light into the picture are compiled with."""
        lean = ("LEAN",) if self.to_screen else ()
        fog = ("FOG",) if picture.fog_density > 0.0 else ()
        return (*lean, *fog, *(("TO_SCREEN", *tone_defines(picture)) if self.writes_screen(picture) else ()))

    def surface_defines(self, picture: PictureSettings) -> tuple[str, ...]:
        """The same of shaders of surfaces."""
        scattering = ("MULTIPLE_SCATTERING",) if picture.multiple_scattering else ()
        smoothing = ("SPECULAR_ANTIALIASING",) if picture.specular_antialiasing else ()
        sampled = (f"SAMPLED_SURROUNDINGS {SAMPLES_AROUND}",) if self.samples_surroundings(picture) else ()
        return (*self.light_defines(picture), *scattering, *smoothing, *sampled)

    def samples_surroundings(self, picture: PictureSettings) -> bool:
        """Whether light from around is sampled for each pixel."""
        return picture.sampled_surroundings and not self.to_screen

    @property
    def shadow_defines(self) -> tuple[str, ...]:
        """What shaders that look shadows up are compiled with."""
        return ("SHADOWS", "SINGLE_SHADOW_TAP") if self.single_shadow_tap else ("SHADOWS",)

    def reads_albedo_table(self, picture: PictureSettings, *, surroundings: bool) -> bool:
        """Whether surfaces look up how much light from everywhere they reflect; who is to be quick approximates it."""
        return not self.to_screen and (surroundings or picture.multiple_scattering)


def tone_defines(picture: PictureSettings) -> tuple[str, ...]:
    """What shaders that turn light into the screen's colours are compiled with."""
    return {"neutral": (), "agx": ("AGX",), "none": ("UNMAPPED",)}[picture.tone_mapping]


FULL: Final = Quality(samples=4, single_shadow_tap=False, shadow_size=2048, lamp_shadow_size=2048, to_screen=False)
FAST: Final = Quality(samples=0, single_shadow_tap=True, shadow_size=1024, lamp_shadow_size=0, to_screen=True)

# For measurements: each pixel is the light along the ray through its middle, in 32 bits, and not an average around it.
EXACT: Final = Quality(
    samples=0,
    single_shadow_tap=False,
    shadow_size=4096,
    lamp_shadow_size=4096,
    to_screen=False,
    light_form="rgba32f",
    stand_ins=False,
)


def interactive_quality(context: Context) -> Quality:
    """FULL on a graphics card; FAST where the processor draws, which makes pictures several times as often (measured)."""
    return FAST if context.is_software else FULL
