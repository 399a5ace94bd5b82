"""Trajectories of our own DEM and of Kratos for `write_audit_files`: right runs, and runs with a fault in their input."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np

DT, EVERY, FRAMES = 2e-5, 40, 100
LAW = 'contact = {{mu = 0.3, kn = 1e5, ks = 8e4, lever_arm = "{arm}"}}\ntime = {{dt = 2e-5{more}}}\n'
RADIUS = [0.04 + 0.004 * (k * 7 % 5) for k in range(27)]
"""Of 27 spheres, or of 25 disks."""


def toml(dimension: int, bodies: str, *, arm: str = "overlap", more: str = "") -> str:
    """A floor under gravity, and how bodies get their masses."""
    down, up, zero = ([*[0.0] * (dimension - 1), last] for last in (-9.81, 1.0, 0.0))
    text = f"gravity = {down}\n" + LAW.format(arm=arm, more=more) + f"{bodies}\n"
    return text + f'[[walls]]\nname = "floor"\npoint = {zero}\nnormal = {up}\n'


CORE: dict[str, tuple[int, Literal["npz", "vtk"], dict[str, float], list[str]]] = {
    "core-2d-npz": (2, "npz", {}, []),
    "core-2d-vtk": (2, "vtk", {}, []),
    "core-2d-gravity": (2, "npz", {"g": 9.80}, ["free"]),
    "core-2d-friction": (2, "vtk", {"mu": 0.6}, ["momentum"]),
    "core-3d-npz": (3, "npz", {}, []),
    "core-3d-vtk": (3, "vtk", {}, []),
    "core-3d-gravity": (3, "vtk", {"g": 9.80}, ["free"]),
    "core-3d-lever-arms": (3, "npz", {"arm": 1.0}, ["spin"]),
    "core-3d-spheres-of-another-density": (3, "npz", {"heavy": 1.5}, ["momentum"]),
}
"""Folder -> dimension, form of its frames, changes of the input, checks that must be violated."""


def write_core(out: Path, names: list[str]) -> dict[str, list[str]]:
    """Frames as `ninedisk.core.dem.files.FrameWriter` writes them of a session."""
    from ninedisk.core import ContactLaw, Disks, Numerics, PlaneWall, Scene, Spheres, SphereScene, Wall
    from ninedisk.core.dem.files import FrameWriter
    from ninedisk.core.dem.session import DemSession
    from ninedisk.core.dem.space.session import SphereSession

    expected = {}
    numerics = Numerics(dt=EVERY * DT, n_steps=FRAMES - 1, contact_dt=DT)
    for name in names:
        d, form, change, found = CORE[name]
        law = ContactLaw(
            kn=1e5, ks=8e4, mu=change.get("mu", 0.3), beta=0.1, lever_arm="radius" if "arm" in change else "overlap"
        )
        k = np.arange(27 if d == 3 else 25)
        grid = np.stack([k % 3, k // 3 % 3, k // 9] if d == 3 else [k % 5, k // 5], axis=1)
        radius = np.array(RADIUS[: len(k)])
        mass = 2000.0 * (4.0 / 3.0 * np.pi * radius**3 if d == 3 else np.pi * radius**2)
        mass = np.where(k % 2 == 1, change.get("heavy", 1.0), 1.0) * mass
        start: dict[str, Any] = {
            "x": 0.1 + 0.13 * grid, "radius": radius, "mass": mass,
            "v": np.stack([np.sin(3.1 * k), np.sin(5.7 * k), np.sin(1.3 * k) - 1.0][-d:], axis=1),
            "omega": np.tile([3.0, -5.0, 7.0], (len(k), 1)) if d == 3 else np.full(len(k), 7.0),
        }  # fmt: skip
        g = change.get("g", 9.81)
        session: DemSession | SphereSession
        if d == 2:
            edges = (Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0), law=law),)
            scene = Scene(disks=Disks(**start), walls=edges, disk_disk=law, gravity=(0.0, -g))
            session = DemSession(scene, numerics)
        else:
            planes = (PlaneWall(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), law=law),)
            spheres = SphereScene(spheres=Spheres(**start), walls=planes, sphere_sphere=law, gravity=(0.0, 0.0, -g))
            session = SphereSession(spheres, numerics)
        writer = FrameWriter(out / name / "frames", form)
        for frame in range(FRAMES):
            session.advance(int(frame > 0))
            writer.write(*session.snapshot())
        (out / name / "run.toml").write_text(toml(d, f"{'spheres' if d == 3 else 'disks'} = {{density = 2000.0}}"))
        expected[name] = found
    return expected


KRATOS = """
import json
import math
import KratosMultiphysics as Kratos
from KratosMultiphysics import DEMApplication as Dem
from KratosMultiphysics.DEMApplication.DEM_analysis_stage import DEMAnalysisStage

G, MU, RADIUS = {g}, {mu}, {radius}
N = range(27)
HEAD = "Begin ModelPartData\\nEnd ModelPartData\\n\\nBegin Properties 0\\nEnd Properties\\n\\n"

def block(name, lines):
    return "Begin " + name + "\\n" + "".join(line + "\\n" for line in lines) + "End " + name.split()[0] + "\\n\\n"

ids = [str(k + 1) for k in N]
text = HEAD + block("Nodes", [f"{{k + 1}} {{0.1 + 0.13 * (k % 3)}} {{0.1 + 0.13 * (k // 3 % 3)}} {{0.1 + 0.13 * (k // 9)}}" for k in N])
text += block("Elements SphericParticle3D", [f"{{k + 1}} 0 {{k + 1}}" for k in N])
text += block("NodalData RADIUS", [f"{{k + 1}} 0 {{RADIUS[k]!r}}" for k in N])
text += block("SubModelPart grains", [block("SubModelPartNodes", ids) + block("SubModelPartElements", ids)])
open("sceneDEM.mdpa", "w").write(text)
text = HEAD + block("Nodes", ["1 -20 -20 0", "2 30 -20 0", "3 0 30 0"]) + block("Conditions RigidFace3D3N", ["1 0 1 2 3"])
data = block("SubModelPartData", ["IDENTIFIER floor", "FIXED_MESH_OPTION 0", "RIGID_BODY_MOTION 0"])
data += block("SubModelPartNodes", ["1", "2", "3"]) + block("SubModelPartConditions", ["1"])
open("sceneDEM_FEM_boundary.mdpa", "w").write(text + block("SubModelPart floor", [data]))
contact = {{
    "DEM_DISCONTINUUM_CONSTITUTIVE_LAW_NAME": "DEM_D_Linear_Custom_Constants", "K_NORMAL": 1e5, "K_TANGENTIAL": 8e4,
    "COEFFICIENT_OF_RESTITUTION": 0.7, "STATIC_FRICTION": MU, "DYNAMIC_FRICTION": MU, "FRICTION_DECAY": 500.0, "ROLLING_FRICTION": 0.0,
    "ROLLING_FRICTION_WITH_WALLS": 0.0, "DEM_ROLLING_FRICTION_MODEL_NAME": "DEMRollingFrictionModelBounded",
}}
json.dump({{
    "materials": [
        {{"material_name": name, "material_id": k + 1, "Variables": own | {{"YOUNG_MODULUS": 1e6, "POISSON_RATIO": 0.0}}}}
        for k, (name, own) in enumerate([("grains", {{"PARTICLE_DENSITY": 2000.0}}), ("floor", {{"COMPUTE_WEAR": False}})])
    ],
    "material_relations": [
        {{"material_names_list": ["grains", other], "material_ids_list": [1, k], "Variables": contact}}
        for k, other in ((1, "grains"), (2, "floor"))
    ],
    "material_assignation_table": [["SpheresPart.grains", "grains"], ["RigidFacePart.floor", "floor"]],
}}, open("MaterialsDEM.json", "w"))
parameters = {{
    "problem_name": "scene", "Dimension": 3, "do_print_results_option": {pyevtk}, "post_vtk_option": {pyevtk}, "post_gid_option": False,
    "OutputTimeStep": 8e-4, "PostVelocity": True, "PostAngularVelocity": True, "PostRadius": True, "PostExportId": {pyevtk},
    "dem_inlet_option": False, "BoundingBoxOption": False, "GravityX": 0.0, "GravityY": 0.0, "GravityZ": -G,
    "solver_settings": {{
        "strategy": "sphere_strategy", "RemoveBallsInitiallyTouchingWalls": False,
        "model_import_settings": {{"input_type": "mdpa", "input_filename": "scene"}},
        "material_import_settings": {{"materials_filename": "MaterialsDEM.json"}},
    }},
    "RotationOption": True, "GlobalDamping": 0.0, "CleanIndentationsOption": False, "DeltaOption": "Absolute", "SearchTolerance": 4e-4,
    "search_tolerance_against_walls": 4e-4, "NeighbourSearchFrequency": 1, "ElementType": "SphericPartDEMElement3D",
    "TranslationalIntegrationScheme": "Symplectic_Euler", "RotationalIntegrationScheme": "Direct_Integration",
    "AutomaticTimestep": False, "MaxTimeStep": 2e-5, "FinalTime": 0.048, "ControlTime": 1e9,
}}

class Stage(DEMAnalysisStage):
    steps = 0

    def Initialize(self):
        super().Initialize()
        for node in self.spheres_model_part.Nodes:
            k = node.Id - 1
            velocity = Kratos.Array3([math.sin(3.1 * k), math.sin(5.7 * k), math.sin(1.3 * k) - 1.0])
            node.SetSolutionStepValue(Kratos.VELOCITY, velocity)
            node.SetSolutionStepValue(Kratos.ANGULAR_VELOCITY, Kratos.Array3([3.0, -5.0, 7.0]))
        # Kratos' general output knows no spheres as cells: it writes a copy of their centres.
        self.copy = Kratos.Model()
        self.points = self.copy.CreateModelPart("SpheresPart")
        self.variables = (Kratos.RADIUS, Kratos.VELOCITY, Kratos.ANGULAR_VELOCITY)
        for variable in self.variables:
            self.points.AddNodalSolutionStepVariable(variable)
        for node in self.spheres_model_part.Nodes:
            self.points.CreateNewNode(node.Id, node.X, node.Y, node.Z)
        self.vtk = Kratos.VtkOutput(self.points, Kratos.Parameters(json.dumps({{
            "model_part_name": "SpheresPart", "file_format": "ascii", "output_precision": 15, "output_path": "frames",
            "write_deformed_configuration": True, "output_control_type": "step", "output_sub_model_parts": False,
            "nodal_solution_step_data_variables": ["RADIUS", "VELOCITY", "ANGULAR_VELOCITY"],
        }})))

    def FinalizeSolutionStep(self):
        super().FinalizeSolutionStep()
        self.steps += 1
        if self.steps % 40 or {pyevtk}:
            return
        for node in self.spheres_model_part.Nodes:
            point = self.points.GetNode(node.Id)
            point.X, point.Y, point.Z = node.X, node.Y, node.Z
            for variable in self.variables:
                point.SetSolutionStepValue(variable, node.GetSolutionStepValue(variable))
        self.points.ProcessInfo[Kratos.STEP] = self.steps
        self.vtk.PrintOutput()

Stage(Kratos.Model(), Kratos.Parameters(json.dumps(parameters))).Run()
"""
KRATOS_RUNS: dict[str, tuple[bool, dict[str, float], list[str]]] = {
    "kratos-3d": (False, {}, []),
    "kratos-3d-gravity": (False, {"g": 9.80}, ["free"]),
    "kratos-3d-friction": (False, {"mu": 0.6}, ["momentum"]),
    "kratos-3d-vtu": (True, {}, []),
    "kratos-3d-vtu-gravity": (True, {"g": 9.80}, ["free"]),
}
"""Folder -> whether Kratos' DEM writes it itself, which needs pyevtk; changes of the input; checks that must be violated."""


def write_kratos(out: Path, names: list[str]) -> dict[str, list[str]]:
    """Legacy VTK by Kratos' own output, or .vtu by that of its DEM; none of what is not there."""
    if importlib.util.find_spec("KratosMultiphysics") is None:
        return {}
    expected = {}
    for name in names:
        pyevtk, change, found = KRATOS_RUNS[name]
        if pyevtk and importlib.util.find_spec("pyevtk") is None:
            continue
        folder = out / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        fields = {"g": 9.81, "mu": 0.3} | change
        (folder / "run.py").write_text(KRATOS.format(**fields, radius=RADIUS, pyevtk=pyevtk))
        done = subprocess.run(
            [sys.executable, "run.py"], cwd=folder, check=False, capture_output=True, text=True, timeout=300
        )
        if done.returncode:
            raise SystemExit(f"{name}: Kratos ended with {done.returncode}: {done.stderr[-500:]}")
        if pyevtk:
            (folder / "scene_Post_VTK_Files").rename(folder / "frames")
        (folder / "run.toml").write_text(toml(3, "spheres = {density = 2000.0}", more=", interval = 8e-4"))
        expected[name] = found
    return expected
