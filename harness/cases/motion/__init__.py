"""Free motion under forces."""
