"""How a scene's light becomes a picture: part of its settings. Everything that costs time is off unless asked for."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Channel = Annotated[float, Meta(ge=0.0, le=1e6)]


class PictureSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Exposure, tone mapping and the effects that a scene asks for."""

    exposure: Annotated[
        float, Meta(ge=-32.0, le=32.0, description="Stops by which pictures are brighter.", extra={"unit": "EV"})
    ] = 0.0
    camera_ev: Annotated[
        Annotated[float, Meta(ge=-32.0, le=32.0)] | None,
        Meta(
            description="EV100 of a camera's setting, for lamps in real units: 15 in full daylight of 100000 lx. Without it a "
            "sun of pi lx makes white white.",
            extra={"unit": "EV"},
        ),
    ] = None
    tone_mapping: Annotated[
        Literal["neutral", "agx", "none"],
        Meta(description="Khronos PBR Neutral keeps colours, AgX is like film, none cuts at white."),
    ] = "neutral"
    multiple_scattering: Annotated[
        bool, Meta(description="Gives rough metals the light back that a single bounce between facets loses.")
    ] = False
    sampled_surroundings: Annotated[
        bool,
        Meta(description="Samples light from around for each pixel: within 2 % from every side, and slow."),
    ] = False
    specular_antialiasing: Annotated[
        bool, Meta(description="Widens highlights where normals change within a pixel: they do not sparkle.")
    ] = False
    fxaa: Annotated[bool, Meta(description="Smooths edges of the finished picture.")] = False
    bloom: Annotated[Share, Meta(description="Share of light that lens and eye scatter around what is bright.")] = 0.0
    ambient_occlusion: Annotated[
        Share, Meta(description="How much nearby things keep light from around out of corners.")
    ] = 0.0
    occlusion_radius: Annotated[
        float, Meta(gt=0.0, le=1000.0, description="How near those are.", extra={"unit": "m"})
    ] = 0.5
    fog_density: Annotated[
        float,
        Meta(
            ge=0.0, le=100.0, description="Share of light that fog takes a metre, at height 0.", extra={"unit": "1/m"}
        ),
    ] = 0.0
    fog_falloff: Annotated[
        float,
        Meta(ge=0.0, le=100.0, description="How fast fog thins with height; 0: nowhere.", extra={"unit": "1/m"}),
    ] = 0.0
    fog_color: Annotated[
        tuple[Channel, Channel, Channel], Meta(description="Radiance of fog that nothing is seen through, linear.")
    ] = (0.5, 0.55, 0.6)

    @property
    def exposure_factor(self) -> float:
        """What radiance is multiplied with. With EV100: Lagarde and de Rousiers, "Moving Frostbite to PBR" (2014), 4.2."""
        camera = 1.0 if self.camera_ev is None else 1.0 / (1.2 * 2.0**self.camera_ev)
        return float(camera * 2.0**self.exposure)
