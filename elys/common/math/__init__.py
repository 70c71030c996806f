"""Array functions for rotations, transforms and boxes: many at once, numpy only.

float32 input gives float32 output, everything else is computed in float64.
"""
