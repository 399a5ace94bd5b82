"""DART."""
