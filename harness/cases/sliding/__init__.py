"""The associated sliding rule (appendix A.3)."""
