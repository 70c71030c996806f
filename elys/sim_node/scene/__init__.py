"""The scene graph over the entities: parents and children, world transforms, loading and snapshots."""
