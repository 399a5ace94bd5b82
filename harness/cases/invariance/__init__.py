"""Laws that hold for every observer."""
