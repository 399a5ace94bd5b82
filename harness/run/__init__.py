"""How cells run: what a run consists of, one cell, many side by side, and how they are judged."""
