"""The parts of a model file by the names that scenes have for them: `car.glb#0/1`, `#image/2`, `#skin/0`, `#clips`."""

from __future__ import annotations

from elys.common.assets.gltf import ImportedModel
from elys.common.errors import AssetError


def part_of_model(model: ImportedModel, name: str, fragment: str) -> str:
    """The reference of a part, of the only mesh if none is named; AssetError, with those there are, if there is no such part."""
    parts = {f"{mesh}/{primitive}": reference for (mesh, primitive), reference in model.meshes.items()}
    if not fragment and len(parts) == 1:
        return next(iter(parts.values()))
    parts |= {f"image/{index}": reference for index, reference in model.images.items()}
    parts |= {f"skin/{index}": reference for index, reference in model.skins.items()}
    if model.clips:
        parts["clips"] = model.clips
    if fragment not in parts:
        some = ", ".join(f"{name}#{part}" for part in list(parts)[:4])
        more = ", ..." if len(parts) > 4 else ""
        raise AssetError(f"{name} has no part '{fragment}'; it has {some or 'nothing to draw'}{more}")
    return parts[fragment]
