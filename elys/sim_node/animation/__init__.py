"""Movement by clips: who plays what, how far, and how several are blended; see docs/animation.md."""
