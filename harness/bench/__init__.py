"""Benchmarks: the same problem on every engine that can express it, physics checked before anything is timed."""
