"""How processes talk: typed topics over zenoh, inside one process, or on disk."""
