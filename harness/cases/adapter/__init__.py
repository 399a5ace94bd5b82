"""Scenes so small that every number is known, one for each capability: what `ninedisk check-engine` runs."""
