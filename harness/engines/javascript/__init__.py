"""Engines in JavaScript and WebAssembly: what their adapters share."""
