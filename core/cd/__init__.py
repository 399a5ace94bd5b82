"""Contact dynamics: problems, solvers, time stepping."""
