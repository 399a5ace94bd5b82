"""Closed forms of the continuous problems, one problem a file."""
