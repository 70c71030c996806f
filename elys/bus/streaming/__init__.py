"""State over a network: to each viewer what its link carries, told against what it has. See docs/streaming.md."""
