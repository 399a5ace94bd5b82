"""Shapes of all bodies of a scene in one table: outlines, and exact circles for disks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ninedisk.core.nurbs.curve import NurbsCurve, powers
from ninedisk.core.nurbs.curve_kernels import ShapeTable
from ninedisk.core.nurbs.shapes import disk
from ninedisk.core.nurbs.table import shape_table, table_of_circles, tables_together
from ninedisk.core.validate import FloatArray


def body_shapes(
    outlines: Sequence[NurbsCurve], outline: NDArray[np.int64], radius: FloatArray
) -> tuple[ShapeTable, NDArray[np.int64], FloatArray]:
    """Table of the shapes of n bodies.

    Parameters
    ----------
    outlines : sequence of NurbsCurve
    outline : ndarray of int64, shape (n,)
        Number of each body's outline, -1 for a disk.
    radius : ndarray, shape (n,)
        Radii of the disks [m]; those of other bodies are not read.

    Returns
    -------
    table : ShapeTable
        The outlines in their order, then the circles.
    shape : ndarray of int64, shape (n,)
        Row of each body.
    radii : ndarray
        Radii of the circles [m].
    """
    is_disk = outline < 0
    radii, circle = np.unique(radius[is_disk], return_inverse=True)
    tables = [shape_table([powers(curve.spans) for curve in outlines])] if outlines else []
    tables += [table_of_circles(disk(1.0).table, radii)] if len(radii) else []
    shape = outline.copy()
    shape[is_disk] = len(outlines) + circle
    return tables_together(tables), shape, radii
