"""The ball time trial: its levels, laid out by code, and its behaviours (scripts/)."""
