"""For how much of a kick a force on a single body acts."""

from __future__ import annotations

from ninedisk.core.array_types import FloatArray
from ninedisk.core.compile import inline_kernel


@inline_kernel
def share_of_kick(time: FloatArray, n: int, dt: float) -> float:
    """Part of the kick from ``t_n`` in which a load acts that begins and ends at these times [s].

    The kick lasts from ``t_n - dt/2`` to ``t_n + dt/2``, but not from before 0.
    """
    first, last = max((n - 0.5) * dt, 0.0), (n + 0.5) * dt
    if time[0] <= first and time[1] >= last:
        return 1.0
    return float(max(min(time[1], last) - max(time[0], first), 0.0) / (last - first))
