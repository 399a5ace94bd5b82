"""Kratos DEM."""
