"""Periodic cells."""
