"""What the drivers of DEM engines share: the request, the memory of this process, the answer."""

import json
import os
import sys

import numpy as np


def read_request():
    """Request of `ninedisk.harness.bench.dem`: JSON on standard input, with the disks' arrays from its file."""
    request = json.load(sys.stdin)
    with np.load(request["disks"]) as data:
        request |= {name: data[name] for name in data.files}
    return request


def resident():
    """Resident memory of this process [bytes]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def kinetic(request, v, omega):
    """Kinetic energy [J]."""
    spin2 = omega**2 if omega.ndim == 1 else (omega**2).sum(axis=1)
    return 0.5 * float(request["mass"] @ (v**2).sum(axis=1) + request["inertia"] @ spin2)


def write_answer(request, **answer):
    """Write the answer; arrays and numbers only, apart from ``version`` and ``error``."""
    with open(request["answer"], "wb") as file:
        np.savez(file, **answer)
