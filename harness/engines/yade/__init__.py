"""YADE."""
