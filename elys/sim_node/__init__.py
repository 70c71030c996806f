"""The simulation: entities, the scene graph and physics, and the node that runs them on the bus."""
