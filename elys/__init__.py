"""ELYS: a game engine of processes on a message bus."""

__version__ = "0.1.0"
