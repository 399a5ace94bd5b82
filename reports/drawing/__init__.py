"""Pictures: charts, sketches, configurations of a run, on common scales, in colours that distinguish engines."""
