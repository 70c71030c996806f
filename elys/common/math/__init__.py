"""Rotations, transforms and boxes: array functions for many at once, and `poses` for one of a thing in plain floats.

Of arrays float32 input gives float32 output, everything else is computed in float64.
"""
