"""What the decorator of the kernels promises."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from ninedisk.core._cache import inline_kernel


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_a_kernel_cannot_allocate() -> None:
    """An array that a kernel would make needs Numba's runtime, which kernels are compiled without."""

    @inline_kernel
    def total(n: int) -> float:
        made = np.zeros(n)
        return made.sum()

    with pytest.raises(numba.core.errors.NumbaError):
        total(3)
