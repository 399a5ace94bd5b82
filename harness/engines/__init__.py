"""The engines, one adapter a module."""
