"""SAPIEN: PhysX."""
