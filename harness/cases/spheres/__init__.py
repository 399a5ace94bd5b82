"""Problems of spheres in space."""
