"""ESyS-Particle."""
