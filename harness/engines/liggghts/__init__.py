"""LIGGGHTS."""
