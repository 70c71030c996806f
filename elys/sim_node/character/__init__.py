"""Characters: kinematic capsules that walk, and the cameras that follow them."""
