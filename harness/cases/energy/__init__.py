"""What one contact remembers: shear that opens, retraced paths, walls that move."""
