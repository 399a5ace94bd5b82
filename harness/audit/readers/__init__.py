"""Files of trajectories: LAMMPS and LIGGGHTS dumps, tables, VTK; columns by name, and the rounding that digits show."""
