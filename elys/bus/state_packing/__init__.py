"""State frames as recordings keep them: told against frames before them, in bits that compress. See docs/recording-format.md."""
