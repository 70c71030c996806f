"""The tree of entities as lines: which are to be seen, in which order, what a search finds. Nothing here draws."""
