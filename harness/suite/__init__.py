"""The verification matrix as tests for pytest: ``pytest --pyargs ninedisk.harness.suite --engine ID``."""
