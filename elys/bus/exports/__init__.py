"""Recordings for other programs: tables of motion, animated models, and what viewers of robots understand."""
