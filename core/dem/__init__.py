"""Explicit DEM: linear contacts, central differences."""
