"""Disks at rest, and the load at which a packing yields."""
