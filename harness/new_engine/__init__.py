"""``ninedisk new-engine``: a package that brings an engine, working as it is written."""
