"""The passes of a picture, in the order in which they run. Each says whether it is needed and sets all state it depends on.

shadow ─> opaque ─> sky ─> grid ─> transparent ─> (resolve) ─> tonemap ─> outline
                                                   picking: alone, on demand
"""
