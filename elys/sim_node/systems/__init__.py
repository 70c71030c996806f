"""What a tick does between commands and frames."""
