"""The verification problems, one family a module."""
