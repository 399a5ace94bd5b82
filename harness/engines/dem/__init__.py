"""The in-house DEM."""
