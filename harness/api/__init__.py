"""What an outsider implements: the protocols of a case and of an engine; with their parameters, capabilities and registry."""
