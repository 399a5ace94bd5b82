"""pymunk (Chipmunk 2-D)."""
