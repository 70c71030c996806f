"""Entities, components, systems: what exists and what it has."""
