"""The in-house contact dynamics."""
