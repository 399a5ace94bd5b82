"""Rows of disks."""
