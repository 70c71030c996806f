"""The passes of a picture, in the order in which they run. Each says whether it is needed and sets all state it depends on.

environment ─> shadow ─> occlusion ─> opaque ─> sky ─> grid ─> transparent ─> (resolve) ─> bloom ─> tonemap ─> fxaa ─> outline
                                                                                picking: alone, on demand
"""
