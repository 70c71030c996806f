"""Gameplay pieces: scripts and prefabs that scenes use as `elys:door.prefab.json` and `elys:door.py#Door`. See docs/pieces.md."""
