"""Physics held against anybody's trajectory: formats, the scene beside it, verdicts with derived allowances."""
