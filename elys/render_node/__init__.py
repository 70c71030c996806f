"""Pictures of a scene: for others on the bus, in a window of its own, or into files."""
