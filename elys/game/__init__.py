"""The ball time trial as a program: who drives by himself, who keeps the times, and what the best ones are."""
