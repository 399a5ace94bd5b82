"""Block on an incline (appendix A.3.4)."""
