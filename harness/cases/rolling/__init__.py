"""Disks that slide, spin and roll on a plane."""
