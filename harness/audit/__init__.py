"""Physics held against any trajectory: formats, the scene beside it, verdicts with derived allowances."""
