"""Nine disks between four walls (appendix A.1)."""
