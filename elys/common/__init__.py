"""What every process must agree on: components, scenes, assets, ids, errors. Imports nothing else of ELYS."""
