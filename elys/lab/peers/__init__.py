"""Other engines behind one face, for those scenes that can be built in them."""
