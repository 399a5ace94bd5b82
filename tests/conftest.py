"""Options and fixtures for the whole test tree."""

pytest_plugins = ["ninedisk.harness.pytest_plugin", "pytester"]
