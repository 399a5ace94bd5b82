"""Files of trajectories, a reader for each form; columns by name, and the rounding that digits or precision show."""
