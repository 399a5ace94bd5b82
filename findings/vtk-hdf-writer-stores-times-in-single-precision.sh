#!/usr/bin/env bash
# What: VTK's writer of VTKHDF stores the times of steps in single precision, and one offset of an array more than there are steps.
# Versions: vtk 9.7.2 and h5py 3.16.0 (PyPI)
# Why a good guess misses: the pipeline's times are double precision, and so are the points beside them: velocities by differences of
#   stored times are off by 0.3 % for steps of 1 ms at 1 min. Readers that hold a file against the specification refuse its offsets.
# Documentation: vtkhdf_specifications.md, "Temporal Data": "{Point,Cell,Field}DataOffsets/{ArrayName} [dims = (NSteps)]"; it says
#   nothing of the precision of Values.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" --quiet --disable-pip-version-check install vtk==9.7.2 h5py==3.16.0 2> "$folder/pip" || { cat "$folder/pip"; exit 1; }
cat > "$folder/run.py" <<'PY'
import sys

import h5py
import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkPoints, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
from vtkmodules.vtkIOHDF import vtkHDFWriter

TIMES = [60.0 + 0.001 * k for k in range(5)]


class Source(VTKPythonAlgorithmBase):
    """One point that moves by 1 m/s, with an array of one number."""

    def __init__(self):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")

    def RequestInformation(self, request, inputs, outputs):
        info = outputs.GetInformationObject(0)
        info.Set(Pipeline.TIME_STEPS(), TIMES, len(TIMES))
        info.Set(Pipeline.TIME_RANGE(), [TIMES[0], TIMES[-1]], 2)
        return 1

    def RequestData(self, request, inputs, outputs):
        info = outputs.GetInformationObject(0)
        t = info.Get(Pipeline.UPDATE_TIME_STEP()) if info.Has(Pipeline.UPDATE_TIME_STEP()) else TIMES[0]
        made, points, cells = vtkPolyData(), vtkPoints(), vtkCellArray()
        points.SetData(numpy_to_vtk(np.array([[t, 0.0, 0.0]]), deep=1))
        cells.InsertNextCell(1, [0])
        made.SetPoints(points)
        made.SetVerts(cells)
        radius = numpy_to_vtk(np.array([0.1]), deep=1)
        radius.SetName("radius")
        made.GetPointData().AddArray(radius)
        made.GetInformation().Set(made.DATA_TIME_STEP(), t)
        vtkPolyData.GetData(outputs).ShallowCopy(made)
        return 1


source, writer = Source(), vtkHDFWriter()
writer.SetInputConnection(source.GetOutputPort())
writer.SetFileName(sys.argv[1])
writer.SetWriteAllTimeSteps(True)
writer.Write()
with h5py.File(sys.argv[1]) as file:
    group = file["VTKHDF"]
    times, places = group["Steps/Values"], group["Points"]
    offsets = group["Steps/PointDataOffsets/radius"][()]
    print(f"vtk {vtkVersion().GetVTKVersion()}: {len(TIMES)} steps of 1 ms at 60 s; points {places.dtype}, times {times.dtype}")
    speed = np.diff(places[:, 0]) / np.diff(np.asarray(times, dtype=float))
    print(f"  speed by stored places and times: {speed.round(6).tolist()} m/s, meant 1")
    print(f"  offsets of the array radius: {offsets.tolist()}, of {len(TIMES)} steps")
    single = times.dtype == np.float32 and places.dtype == np.float64 and np.abs(speed - 1.0).max() > 1e-4
    more = len(offsets) == len(TIMES) + 1
as_described = bool(single and more)
print("as described: times in single precision, one offset more than steps" if as_described else "changed")
sys.exit(0 if as_described else 1)
PY
"$folder/venv/bin/python" "$folder/run.py" "$folder/run.vtkhdf"
