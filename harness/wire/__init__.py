"""The wire protocol for engines of any language: its schemas, and the adapter of an engine that is a command."""
