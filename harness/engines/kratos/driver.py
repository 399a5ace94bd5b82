"""Driver of Kratos DEM, under the harness' Python: one simulation, and its input files, which are plain text.

A step of Kratos' symplectic Euler scheme takes (positions t_n, velocities v_{n-1/2}) and the walls where they are, computes the
forces at t_n, and ends with (positions t_{n+1}, velocities v_{n+1/2}); slip is that of the displacements since t_{n-1}. The walls
are therefore put to their places of t_n before that step. With a = xi dt/2:

- lagged damping ``v+ = v- + dt (F/m - xi v-)``: an external force ``-xi m v-`` and a moment ``-xi I w-``;
- central damping ``v+ = ((1 - a) v- + dt F/m)/(1 + a)``: the same with nodal masses and inertias times ``1 + a``, which gravity and
  dashpots, computed with the particles' own masses, do not see;
- start ``v_{1/2} = v_0 + dt/2 (F_0/m - xi v_0)``: the first step starts from v_0 without drag and is corrected at its end by the
  force that it shows;
- both forms have ``v_n = (v- + v+)/2``.
Kratos writes into the current folder and much to standard output.
"""

import json
import os
import sys
from importlib import metadata

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # -P keeps folders off the path
sys.path.insert(1, os.path.join(sys.path[0], "..", "drivers"))

import KratosMultiphysics as Kratos
import numpy as np
from driver_parts import SpringRun, clock, number, rough, serve
from KratosMultiphysics import DEMApplication as Dem
from KratosMultiphysics.DEMApplication.DEM_analysis_stage import DEMAnalysisStage

LAW = "DEM_D_Linear_Custom_Constants"
"""Linear springs and dashpot without tension, Coulomb friction; stiffnesses given pair by pair, whatever Young's modulus."""

ROLLING = {
    "": "DEMRollingFrictionModelBounded",
    "constant": "DEMRollingFrictionModelConstantTorque",
    "viscous": "DEMRollingFrictionModelViscousTorque",
}

NAME = "scene"
HEAD = "Begin ModelPartData\nEnd ModelPartData\n\nBegin Properties 0\nEnd Properties\n\n"


SEARCH = 0.01
"""Search tolerance of contacts in units of the smallest radius: neighbours are searched in every step, so it only needs to exceed
round-off."""


class Run(SpringRun):
    """One simulation."""

    name = "Kratos"

    def __init__(self, request):
        super().__init__(request)
        self.reach, self.time = request["extra"]["reach"], 0.0
        middle = 0.5 * (self.x0.min(axis=0) + self.x0.max(axis=0))
        self.along = [
            (middle - pose[0:2]) @ (-pose[3], pose[2]) for pose in self.path[0]
        ]  # middle of each edge, opposite the middle of the disks
        self.shifts = np.array([[along - self.reach, along + self.reach] for along in self.along]).reshape(-1, 2)
        self.ends = self._ends(0)
        self._build()

    def version(self):
        return metadata.version("KratosDEMApplication")

    def settings(self):
        return {"contact law": LAW, "edge half-length [m]": self.reach}

    def _build(self):
        density = self.mass / (np.pi * self.radius**2)
        material = np.unique(self.material, return_inverse=True)[1]
        rows = np.column_stack([density, material])
        kinds, first, kind = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        files = {
            f"{NAME}DEM.mdpa": disks_file(self.x0, self.radius, kind.reshape(-1).tolist()),
            f"{NAME}DEM_FEM_boundary.mdpa": walls_file(self.ends.tolist()),
            "MaterialsDEM.json": materials(self, kinds[:, 0].tolist(), first.tolist()),
        }
        for name, text in files.items():
            with open(name, "w", encoding="ascii") as file:
                file.write(text)
        Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
        text = parameters(
            self.dt,
            self.gravity.tolist(),
            SEARCH * float(self.radius.min()),
            any(law["rolling"] for law in self.all_laws),
        )
        self.stage = DEMAnalysisStage(Kratos.Model(), Kratos.Parameters(text))
        self.stage.Initialize()
        self.solver, self.part = self.stage._GetSolver(), self.stage.spheres_model_part
        names = ("SpheresPart", "ClusterPart", "DEMInletPart", "RigidFacePart")
        self.parts = [self.solver.all_model_parts.Get(name) for name in names]
        self.tell_time, self.strategy = (
            Dem.AuxiliaryUtilities().UpdateTimeInOneModelPart,
            self.solver.cplusplus_strategy,
        )
        self.nodes = sorted(self.part.Nodes, key=lambda node: node.Id)
        self.numbers, self.all_nodes = {node.Id: i for i, node in enumerate(self.nodes)}, Nodes(self.nodes)
        for properties in self.part.Properties:  # the law itself has no dashpot against walls here: see the adapter
            for pair in properties.GetSubProperties():
                wall = (
                    max(properties.Id, pair.Id) - len(kinds) - 1
                )  # materials are numbered from 1, those of disks first
                pair[Dem.DAMPING_GAMMA] = self.law["beta"] if wall < 0 else self.walls[wall]["law"]["beta"]
        for i, node in enumerate(self.nodes):
            node.SetSolutionStepValue(Kratos.NODAL_MASS, float(self.mass[i] * self.inflate))
            node.SetSolutionStepValue(Dem.PARTICLE_MOMENT_OF_INERTIA, float(self.inertia[i] * self.inflate))
        faces = self.stage.rigid_face_model_part
        self.wall_nodes = Nodes(
            node
            for w in range(len(self.walls))
            for node in sorted(faces.GetSubModelPart(f"wall{w}").Nodes, key=lambda node: node.Id)
        )

    def _ends(self, row):
        """End points of the walls' edges at a contact step, shape (m, 2, 3); material points of the walls."""
        pose = self.path[row]
        ends = np.zeros((len(pose), 2, 3))
        along = np.column_stack([-pose[:, 3], pose[:, 2]])
        ends[:, :, :2] = pose[:, None, 0:2] + self.shifts[:, :, None] * along[:, None]
        return ends

    def _place_walls(self, step):
        if step > len(self.path) or not self.walls:
            return  # at rest, and known to Kratos as such
        before, self.ends = self.ends, self._ends(min(step, len(self.path) - 1))
        displacement = self.ends - before
        self.wall_nodes.move(self.ends)
        self.wall_nodes.write(Dem.DELTA_DISPLACEMENT, displacement)
        self.wall_nodes.write(Kratos.VELOCITY, displacement / self.dt)

    def start(self):
        """Initial velocities."""
        for i, node in enumerate(self.nodes):
            node.SetSolutionStepValue(Kratos.VELOCITY, vector(self.v0[i]))
            node.SetSolutionStepValue(Kratos.ANGULAR_VELOCITY, [0.0, 0.0, float(self.omega0[i])])

    def read(self, variable):
        """A vector variable of all disks, shape (n, 3)."""
        return self.all_nodes.read(variable)

    def advance(self, sampled):
        """All steps; returns the seconds that are not spent on samples, see `clock`."""
        wanted, last = {step * self.substeps for step in sampled}, max(sampled) * self.substeps
        spent, begin = 0.0, clock()
        for step in range(last + 1):
            sampling = step in wanted
            if sampling:
                before = self.state()
            self._step(step, sampling)
            if step == 0:
                self._correct_start()
            if sampling:
                spent += clock() - begin
                self._sample(step, *before)
                begin = clock()
        return spent + clock() - begin

    def _step(self, step, sampling):
        self._place_walls(step)
        # What the solver's own steps do, without those of the stage around it, whose housekeeping takes ten times as long, nor the solver's
        # in Python, which takes a quarter.
        self.time += self.dt
        for part in self.parts:
            self.tell_time(part, self.time, self.dt, sampling)  # contact forces are kept when it is time to print
        self.strategy.ResetPrescribedMotionFlagsRespectingImposedDofs()
        self.strategy.InitializeSolutionStep()
        if (self.xi and step) or self.forces_on:
            xi, force, moment = self.xi if step else 0.0, np.zeros((self.n, 3)), np.zeros((self.n, 3))
            force[:, :2] = (-xi * self.mass)[:, None] * self.read(Kratos.VELOCITY)[:, :2]
            moment[:, 2] = (-xi * self.inertia) * self.read(Kratos.ANGULAR_VELOCITY)[:, 2]
            load = self.loads_at(step) if self.forces_on else np.zeros(3)
            force[:, :2] += load[..., :2]
            moment[:, 2] += load[..., 2]
            self.all_nodes.write(Kratos.EXTERNAL_APPLIED_FORCE, force)
            self.all_nodes.write(Kratos.EXTERNAL_APPLIED_MOMENT, moment)
        self.strategy.SolveSolutionStep()
        self.strategy.FinalizeSolutionStep()

    def _correct_start(self):
        """From ``v_0 + dt F_0/m`` (mass as Kratos has it) to ``v_{1/2}``; the disks and their turns follow."""
        dt, v, w = self.dt, self.read(Kratos.VELOCITY)[:, :2], self.read(Kratos.ANGULAR_VELOCITY)[:, 2]
        half = self.v0 + 0.5 * ((v - self.v0) * self.inflate - dt * self.xi * self.v0)
        spin = self.omega0 + 0.5 * ((w - self.omega0) * self.inflate - dt * self.xi * self.omega0)
        for i, node in enumerate(self.nodes):
            displacement, turn = dt * half[i], [0.0, 0.0, float(dt * spin[i])]
            node.X, node.Y = (float(c) for c in self.x0[i] + displacement)
            for name in (Dem.DELTA_DISPLACEMENT, Kratos.DISPLACEMENT):
                node.SetSolutionStepValue(name, vector(displacement))
            for name in (Kratos.DELTA_ROTATION, Dem.PARTICLE_ROTATION_ANGLE):
                node.SetSolutionStepValue(name, turn)
            node.SetSolutionStepValue(Kratos.VELOCITY, vector(half[i]))
            node.SetSolutionStepValue(Kratos.ANGULAR_VELOCITY, [0.0, 0.0, float(spin[i])])

    def state(self):
        """Positions [m], velocities [m/s], spins [rad/s] and angles [rad] that Kratos holds."""
        x = self.all_nodes.places()[:, :2]
        v, omega = self.read(Kratos.VELOCITY)[:, :2], self.read(Kratos.ANGULAR_VELOCITY)[:, 2]
        return x, v, omega, self.read(Dem.PARTICLE_ROTATION_ANGLE)[:, 2]

    def _sample(self, step, x, v, omega, angle):
        """State at ``t_n``: positions and angles before the step, mean velocities, the forces that the step has computed."""
        _, after, spun, _ = self.state()
        pose = self.pose(step)
        found = {**self._disk_contacts(x), **self._wall_contacts(x, pose)}
        loads, elastic = self.sums(found, pose)
        if step:
            v, omega = 0.5 * (v + after), 0.5 * (omega + spun)
        else:
            v, omega = self.v0, self.omega0
        self.sample(step // self.substeps, x, v, omega, angle, self.watched(found), pose, loads, elastic)

    def _disk_contacts(self, x):
        """Touching pairs of disks: ``{(i, j): (fn, fs, overlap)}``, forces as Kratos keeps them."""
        self.solver.PrepareContactElementsForPrinting()
        found = {}
        for element in self.stage.contact_model_part.Elements:
            one, two = (self.numbers[node.Id] for node in element.GetNodes())
            i, j = min(one, two), max(one, two)
            d = x[j] - x[i]
            distance = float(np.hypot(*d))
            overlap = float(self.radius[i] + self.radius[j] - distance)
            if overlap > 0.0:
                force = element.GetValue(Dem.GLOBAL_CONTACT_FORCE)
                force = np.array((force[0], force[1]))  # by component, as iterating one is slow
                if one > two:
                    force = -force
                normal = d / distance
                found[i, j] = (float(-force @ normal), float(force @ (-normal[1], normal[0])), overlap)
        return found

    def _wall_contacts(self, x, pose):
        """Touching pairs of a disk and a wall, as `_disk_contacts`.

        Kratos keeps the sum of the walls' forces on a disk. What is left of it without the springs' normal forces is made of the
        shear forces, which two walls that are not parallel share in one way only; else they are not observed.
        """
        found = {}
        total = -self.read(Dem.RIGID_ELEMENT_FORCE)[:, :2]  # on the disks
        away = x[:, None] - pose[None, :, 0:2]
        near = (away * pose[None, :, 2:4]).sum(axis=2) < 1.01 * self.radius[
            :, None
        ]  # which of them touch is seen below
        for i in np.flatnonzero(near.any(axis=1)).tolist():
            touching = []
            for w in np.flatnonzero(near[i]).tolist():
                normal = pose[w, 2:4]
                overlap = float(self.radius[i] - (x[i] - pose[w, 0:2]) @ normal)
                if overlap > 0.0:
                    touching.append((w, self.law_of(i, self.n + w)["kn"] * overlap, overlap, -normal))
            if not touching:
                continue
            left = total[i] + sum(fn * normal for _, fn, _, normal in touching)
            shearing = [w for w, *_ in touching if rough(self.law_of(i, self.n + w))]
            tangents = np.array([(pose[w, 3], -pose[w, 2]) for w in shearing]).reshape(-1, 2).T
            solved, _, rank, _ = np.linalg.lstsq(tangents, left, rcond=1e-9)
            # An overlap is known to some units of round-off of the coordinates: disks that just touch have no force beyond it.
            unsure = 16.0 * float(np.spacing(np.abs(x).max())) * max(law["kn"] for law in self.all_laws)
            if not np.abs(tangents @ solved - left).max() <= 1e-6 * max(fn for _, fn, _, _ in touching) + unsure:
                raise RuntimeError(
                    f"the forces of walls on disk {i} are {total[i].tolist()} N in Kratos; those of its springs are "
                    f"{[fn for _, fn, _, _ in touching]} N: it missed or added a contact"
                )
            shear = dict(
                zip(shearing, solved if rank == len(shearing) else np.full(len(shearing), np.nan), strict=True)
            )
            for w, fn, overlap, _ in touching:
                found[i, self.n + w] = (fn, float(shear.get(w, 0.0)), overlap)
        return found


class Nodes:
    """Values of nodes, all at once: one by one each takes Kratos microseconds to find out of which kind it is."""

    def __init__(self, nodes):
        self.array, self.all = Kratos.NodesArray(), Kratos.VariableUtils()
        for node in nodes:  # by their numbers, in which order Kratos keeps them
            self.array.append(node)

    def read(self, variable):
        """A vector variable, shape (nodes, 3)."""
        return np.array(self.all.GetSolutionStepValuesVector(self.array, variable, 0, 3)).reshape(-1, 3)

    def write(self, variable, values):
        self.all.SetSolutionStepValuesVector(self.array, variable, Kratos.Vector(values.ravel()), 0)

    def places(self):
        """Positions [m], shape (nodes, 3)."""
        return np.array(self.all.GetCurrentPositionsVector(self.array, 3)).reshape(-1, 3)

    def move(self, places):
        self.all.SetCurrentPositionsVector(self.array, Kratos.Vector(places.ravel()))


def vector(values):
    """A vector of Kratos in the plane z = 0; a list takes it four times as long to read."""
    return Kratos.Array3([float(values[0]), float(values[1]), 0.0])


def block(name, lines):
    """A block of an mdpa file."""
    body = "".join(f"{line}\n" for line in lines)
    return f"Begin {name}\n{body}End {name.split()[0]}\n\n"


def disks_file(x, radius, kind):
    """Disks as nodes 1..n, with a sub model part for each kind."""
    n = len(x)
    text = HEAD + block("Nodes", (f"{i + 1} {number(x[i][0])} {number(x[i][1])} 0.0" for i in range(n)))
    text += block("Elements CylinderParticle2D", (f"{i + 1} 0 {i + 1}" for i in range(n)))
    text += block("NodalData RADIUS", (f"{i + 1} 0 {number(radius[i])}" for i in range(n)))
    for k in range(max(kind) + 1):
        members = [str(i + 1) for i in range(n) if kind[i] == k]
        parts = block("SubModelPartNodes", members) + block("SubModelPartElements", members)
        text += block(f"SubModelPart kind{k}", [parts])
    return text


def walls_file(edges):
    """Walls as edges, ``edges`` the end points of each, with a sub model part for each."""
    ends = [(w, end) for w, pair in enumerate(edges) for end in pair]
    text = HEAD + block("Nodes", (f"{k + 1} {number(end[0])} {number(end[1])} 0.0" for k, (_, end) in enumerate(ends)))
    text += block("Conditions RigidEdge2D2N", (f"{w + 1} 0 {2 * w + 1} {2 * w + 2}" for w in range(len(edges))))
    for w in range(len(edges)):
        data = block("SubModelPartData", [f"IDENTIFIER wall{w}", "FIXED_MESH_OPTION 0", "RIGID_BODY_MOTION 0"])
        nodes = block("SubModelPartNodes", [str(2 * w + 1), str(2 * w + 2)])
        text += block(f"SubModelPart wall{w}", [data + nodes + block("SubModelPartConditions", [str(w + 1)])])
    return text


def materials(run, densities, first):
    """Materials: the kinds of disks by density and material, then the walls; relations of disks among themselves and with each wall.

    ``first`` holds a disk of each kind.
    """
    kinds, walls = len(densities), len(run.walls)
    names = [f"kind{k}" for k in range(kinds)] + [f"wall{w}" for w in range(walls)]
    # Young's modulus only shares the overlap of two disks between them, and that equally where it is the same.
    common = {"YOUNG_MODULUS": run.law["kn"], "POISSON_RATIO": 0.0}
    found = [
        {"material_name": name, "material_id": k + 1, "Variables": {**common, **own}}
        for k, (name, own) in enumerate(
            zip(
                names,
                [{"PARTICLE_DENSITY": density} for density in densities] + [{"COMPUTE_WEAR": False}] * walls,
                strict=True,
            )
        )
    ]
    pairs = [(a, b, run.law_of(first[a], first[b])) for a in range(kinds) for b in range(a, kinds)]
    pairs += [(a, kinds + w, run.law_of(first[a], run.n + w)) for a in range(kinds) for w in range(walls)]
    relations = [
        {
            "material_names_list": [names[a], names[b]],
            "material_ids_list": [a + 1, b + 1],
            "Variables": contact(pair_law),
        }
        for a, b, pair_law in pairs
    ]
    table = [[f"SpheresPart.kind{k}", f"kind{k}"] for k in range(kinds)]
    table += [[f"RigidFacePart.wall{w}", f"wall{w}"] for w in range(walls)]
    return json.dumps(
        {"materials": found, "material_relations": relations, "material_assignation_table": table}, allow_nan=False
    )


def contact(law):
    """Variables of one relation; a contact without friction or without shear spring carries no shear force."""
    mu = law["mu"] if rough(law) else 0.0
    return {
        "DEM_DISCONTINUUM_CONSTITUTIVE_LAW_NAME": LAW,
        "K_NORMAL": law["kn"],
        "K_TANGENTIAL": law["ks"] if rough(law) else law["kn"],
        "COEFFICIENT_OF_RESTITUTION": 1.0,  # the dashpot's ratio is set by the driver
        "STATIC_FRICTION": mu,
        "DYNAMIC_FRICTION": mu,
        "FRICTION_DECAY": 500.0,
        "ROLLING_FRICTION": law["rolling"]["mu"] if law["rolling"] else 0.0,
        "ROLLING_FRICTION_WITH_WALLS": law["rolling"]["mu"] if law["rolling"] else 0.0,
        "DEM_ROLLING_FRICTION_MODEL_NAME": ROLLING[law["rolling"]["model"] if law["rolling"] else ""],
    }


def parameters(dt, gravity, tolerance, rolls, dimension=2):
    """Parameters of the analysis."""
    return json.dumps(
        {
            "problem_name": NAME,
            "Dimension": dimension,
            "do_print_results_option": False,
            "dem_inlet_option": False,
            "BoundingBoxOption": False,
            "GravityX": gravity[0],
            "GravityY": gravity[1],
            "GravityZ": gravity[2] if dimension == 3 else 0.0,
            "solver_settings": {
                "strategy": "sphere_strategy",
                "RemoveBallsInitiallyTouchingWalls": False,
                "model_import_settings": {"input_type": "mdpa", "input_filename": NAME},
                "material_import_settings": {"materials_filename": "MaterialsDEM.json"},
            },
            "RotationOption": True,
            "RollingFrictionOption": rolls,
            "GlobalDamping": 0.0,
            "CleanIndentationsOption": False,
            "DeltaOption": "Absolute",
            "SearchTolerance": tolerance,
            "search_tolerance_against_walls": tolerance,
            "NeighbourSearchFrequency": 1,
            "ContactMeshOption": True,
            "PostRigidElementForces": True,
            "ElementType": "CylinderPartDEMElement2D" if dimension == 2 else "SphericPartDEMElement3D",
            "TranslationalIntegrationScheme": "Symplectic_Euler",
            "RotationalIntegrationScheme": "Direct_Integration",
            "AutomaticTimestep": False,
            "MaxTimeStep": dt,
            "FinalTime": 1e9 * dt,
            "ControlTime": 1e9,
        },
        allow_nan=False,
    )


def make(request):
    """The run."""
    if request["scene"].get("dimension") == 3:
        import space_driver

        return space_driver.Run(request)
    return Run(request)


if __name__ == "__main__":
    serve(make)
