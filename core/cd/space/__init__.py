"""Contact dynamics in space: spheres, boxes and plane walls."""
