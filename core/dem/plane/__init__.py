"""The inner loop of the DEM in 2D: disks, grains of other outlines, periodic cells."""
