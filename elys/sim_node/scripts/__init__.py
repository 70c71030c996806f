"""Behaviours that users write: Python classes that entities carry. See docs/scripts.md."""
