"""The DEM in 3D: spheres and planes."""
