"""Jolt."""
