"""What the drivers of several engines need for their histories: plain numpy, no engine."""

import numpy as np


def gaps(run, x, radius, point, normal):
    """Gaps of the watched pairs, shape (samples, pairs)."""
    gaps = np.empty((len(x), len(run.pairs)))
    for c, (i, j) in enumerate(run.pairs):
        if j < run.n:
            gaps[:, c] = np.linalg.norm(x[:, j] - x[:, i], axis=1) - radius[i] - radius[j]
        else:
            w = j - run.n
            gaps[:, c] = ((x[:, i] - point[:, w]) * normal[:, w]).sum(axis=1) - radius[i]
    return gaps
