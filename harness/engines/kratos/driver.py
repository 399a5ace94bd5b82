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
In 2D a wall is an edge, in 3D a triangle, moved by its nodes.

Kratos keeps the sum of the forces of walls on a body, see `Run._disks_at_walls` and `Run._spheres_at_walls`. Without friction there is
Hertz' law of spheres, too: of materials with nu = 0, whose moduli give each contact its E*.

Kratos writes into the current folder and much to standard output.
"""

import json
import math
import os
import sys
from importlib import metadata

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # -P keeps folders off the path
sys.path.insert(1, os.path.join(sys.path[0], "..", "drivers"))

import KratosMultiphysics as Kratos
import numpy as np
from driver_parts import SpringRun, carries_shear, clock, in_3d, length, number, numbers, serve, spin_in_3d, triangle
from KratosMultiphysics import DEMApplication as Dem
from KratosMultiphysics.DEMApplication.DEM_analysis_stage import DEMAnalysisStage

LAW = "DEM_D_Linear_Custom_Constants"
"""Linear springs and dashpot without tension, Coulomb friction; stiffnesses given pair by pair, whatever Young's modulus."""
HERTZ = "DEM_D_Hertz_viscous_Coulomb"

ELEMENTS = {2: ("CylinderParticle2D", "CylinderPartDEMElement2D"), 3: ("SphericParticle3D", "SphericPartDEMElement3D")}
"""Of bodies: in their file, and in the parameters."""
WALLS = {2: "RigidEdge2D2N", 3: "RigidFace3D3N"}

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
        self.elastic = request["extra"].get("elastic", [])  # Young's modulus of the spheres, then of each wall
        self.model, self.angle = HERTZ if self.elastic else LAW, np.zeros((self.n, 3))
        middle = 0.5 * (self.x0.min(axis=0) + self.x0.max(axis=0))
        if self.dimension == 2:
            along = [
                (middle - row[0:2]) @ (-row[3], row[2]) for row in self.path[0]
            ]  # middle of each edge, opposite the middle of the disks
            self.shifts = np.array([[each - self.reach, each + self.reach] for each in along]).reshape(-1, 2)
            self.corners = self._ends(0)
        else:
            self.corners = np.array([triangle(middle, row[0:3], row[3:6], self.reach) for row in self.path[0]])
        self._build()

    def version(self):
        return metadata.version("KratosDEMApplication")

    def settings(self):
        size = "edge half-length [m]" if self.dimension == 2 else "triangle's inradius [m]"
        return {"contact law": self.model, size: self.reach}

    def _build(self):
        volume = np.pi * self.radius**2 if self.dimension == 2 else 4.0 / 3.0 * np.pi * self.radius**3
        material = np.unique(self.material, return_inverse=True)[1]
        rows = np.column_stack([self.mass / volume, material])
        kinds, first, kind = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        files = {
            f"{NAME}DEM.mdpa": bodies_file(
                in_3d(self.x0), self.radius, kind.reshape(-1).tolist(), ELEMENTS[self.dimension][0]
            ),
            f"{NAME}DEM_FEM_boundary.mdpa": walls_file(self.corners.tolist(), WALLS[self.dimension]),
            "MaterialsDEM.json": materials(self, kinds[:, 0].tolist(), first.tolist()),
        }
        for name, text in files.items():
            with open(name, "w", encoding="ascii") as file:
                file.write(text)
        Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
        self.stage = DEMAnalysisStage(Kratos.Model(), Kratos.Parameters(parameters(self)))
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
        # The law itself has no dashpot against walls of 2D here: see the adapter. Hertz' one is 2 gamma sqrt(m S), S the tangent stiffness.
        share = math.sqrt(5.0 / 6.0) if self.elastic else 1.0
        for properties in self.part.Properties:
            for pair in properties.GetSubProperties():
                wall = (
                    max(properties.Id, pair.Id) - len(kinds) - 1
                )  # materials are numbered from 1, those of bodies first
                pair[Dem.DAMPING_GAMMA] = share * (self.law if wall < 0 else self.walls[wall]["law"])["beta"]
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
        """End points of the edges of walls of 2D at a contact step, shape (m, 2, 3); material points of the walls."""
        pose = self.path[row]
        ends = np.zeros((len(pose), 2, 3))
        along = np.column_stack([-pose[:, 3], pose[:, 2]])
        ends[:, :, :2] = pose[:, None, 0:2] + self.shifts[:, :, None] * along[:, None]
        return ends

    def _place_walls(self, step):
        """Put edges or triangles, material points of walls, where these are at a contact step, with what they moved by in it."""
        if step > len(self.path) or not self.walls:
            return  # at rest, and known to Kratos as such
        before = self.corners
        if self.dimension == 2:
            self.corners = self._ends(min(step, len(self.path) - 1))
            velocity = (self.corners - before) / self.dt
        else:
            here, there = self.pose(max(step - 1, 0)), self.pose(step)
            self.corners, velocity = np.zeros((2, *before.shape))
            for w, (old, new) in enumerate(zip(here, there, strict=True)):
                turned = rotation(old[3:6], new[3:6], self.dt * new[9:12])
                for k, corner in enumerate(before[w]):
                    self.corners[w, k] = new[0:3] + turned @ (corner - old[0:3])
                    velocity[w, k] = new[6:9] + np.cross(new[9:12], self.corners[w, k] - new[0:3])
        self.wall_nodes.move(self.corners)
        self.wall_nodes.write(Dem.DELTA_DISPLACEMENT, self.corners - before)
        self.wall_nodes.write(Kratos.VELOCITY, velocity)

    def start(self):
        """Initial velocities."""
        self._set(self.v0, self.omega0)

    def _set(self, v, omega):
        for node, velocity, spin in zip(self.nodes, in_3d(v), spin_in_3d(omega), strict=True):
            node.SetSolutionStepValue(Kratos.VELOCITY, vector(velocity))
            node.SetSolutionStepValue(Kratos.ANGULAR_VELOCITY, vector(spin))

    def read(self, variable):
        """A vector variable of all bodies, shape (n, 3)."""
        return self.all_nodes.read(variable)

    def own(self, vectors):
        """The scene's components of vectors."""
        return vectors[:, : self.dimension]

    def own_spins(self, vectors):
        """The scene's components of spins."""
        return vectors[:, 2] if self.dimension == 2 else vectors

    def advance(self, sampled):
        """All steps; returns the seconds that are not spent on samples, see `clock`."""
        wanted, last = {step * self.substeps for step in sampled}, max(sampled) * self.substeps
        spent, begin = 0.0, clock()
        for step in range(last + 1):
            sampling = step in wanted
            if sampling:
                before = self.state()
            self._place_walls(step)
            self._step(step, sampling)
            if step == 0:
                self._correct_start()
            if sampling:
                spent += clock() - begin
                self._sample(step, *before)
                begin = clock()
            if self.dimension == 3:
                self.angle = self.angle + self.dt * self.read(Kratos.ANGULAR_VELOCITY)
        return spent + clock() - begin

    def _step(self, step, sampling):
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
        """From ``v_0 + dt F_0/m`` (mass as Kratos has it) to ``v_{1/2}``; the bodies and their turns follow."""
        dt, (_, v, w, _) = self.dt, self.state()
        half = self.v0 + 0.5 * ((v - self.v0) * self.inflate - dt * self.xi * self.v0)
        spin = self.omega0 + 0.5 * ((w - self.omega0) * self.inflate - dt * self.xi * self.omega0)
        places, displacements, turns = in_3d(self.x0 + dt * half), in_3d(dt * half), spin_in_3d(dt * spin)
        for i, node in enumerate(self.nodes):
            node.X, node.Y, node.Z = places[i].tolist()
            for name in (Dem.DELTA_DISPLACEMENT, Kratos.DISPLACEMENT):
                node.SetSolutionStepValue(name, vector(displacements[i]))
            for name in (Kratos.DELTA_ROTATION, Dem.PARTICLE_ROTATION_ANGLE):
                node.SetSolutionStepValue(name, vector(turns[i]))
        self._set(half, spin)

    def state(self):
        """Positions [m], velocities [m/s], spins [rad/s] and angles [rad] that Kratos holds; of spheres the sums of their spins."""
        angle = self.read(Dem.PARTICLE_ROTATION_ANGLE)[:, 2] if self.dimension == 2 else self.angle
        v, omega = self.own(self.read(Kratos.VELOCITY)), self.own_spins(self.read(Kratos.ANGULAR_VELOCITY))
        return self.own(self.all_nodes.places()), v, omega, angle

    def _sample(self, step, x, v, omega, angle):
        """State at ``t_n``: positions and angles before the step, mean velocities, the forces that the step has computed."""
        _, after, spun, _ = self.state()
        pose, elastic = self.pose(step), None
        total = -self.own(self.read(Dem.RIGID_ELEMENT_FORCE))  # of walls on the bodies
        found = self._pairs(x)
        if self.dimension == 2:
            found.update(self._disks_at_walls(x, pose, total))
            loads, elastic = self.sums(found, pose)
        else:
            loads = self._spheres_at_walls(x, pose, total, found)
        if step:
            v, omega = 0.5 * (v + after), 0.5 * (omega + spun)
        else:
            v, omega = self.v0, self.omega0
        self.sample(step // self.substeps, x, v, omega, angle, found, loads, elastic)

    def _pairs(self, x):
        """Touching pairs of bodies: ``{(i, j): (fn, fs, overlap)}``, forces as Kratos keeps them."""
        self.solver.PrepareContactElementsForPrinting()
        found = {}
        for element in self.stage.contact_model_part.Elements:
            one, two = (self.numbers[node.Id] for node in element.GetNodes())
            i, j = min(one, two), max(one, two)
            d = x[j] - x[i]
            distance = length(d)
            overlap = float(self.radius[i] + self.radius[j] - distance)
            if overlap > 0.0:
                force = element.GetValue(Dem.GLOBAL_CONTACT_FORCE)
                # By component, as iterating one is slow.
                force = np.array((force[0], force[1]) if self.dimension == 2 else (force[0], force[1], force[2]))
                if one > two:
                    force = -force
                normal = d / distance
                fn = float(-force @ normal)
                fs = float(force @ (-normal[1], normal[0])) if self.dimension == 2 else force + fn * normal
                found[i, j] = fn, fs, overlap
        return found

    def _disks_at_walls(self, x, pose, total):
        """Touching pairs of a disk and a wall, as `_pairs`.

        What is left of the sum of the walls' forces without the springs' normal forces is made of the shear forces, which two walls that
        are not parallel share in one way only; else they are not observed.
        """
        found = {}
        away = x[:, None] - pose[None, :, 0:2]
        # Which of them touch is seen below.
        near = (away * pose[None, :, 2:4]).sum(axis=2) < 1.01 * self.radius[:, None]
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
            shearing = [w for w, *_ in touching if carries_shear(self.law_of(i, self.n + w))]
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

    def _spheres_at_walls(self, x, pose, total, found):
        """Add touching pairs of a sphere and a wall to ``found``; returns the force on each wall [N].

        Where no wall has a dashpot, normal forces follow from overlaps; what is left is the shear force of the one rough wall, and of
        several it is not observed. Walls with dashpots are all smooth: their normal forces are what the sum is made of, where that is so
        in one way only.
        """
        loads = np.zeros((len(self.walls), 3))
        for i in range(self.n):
            overlap = self.radius[i] - np.einsum("wc,wc->w", x[i] - pose[:, 0:3], pose[:, 3:6])
            touching = np.flatnonzero(overlap > 0.0).tolist()
            if not touching:
                continue
            laws = [self.law_of(i, self.n + w) for w in touching]
            push = [normal_force(law, self.radius[i], float(overlap[w])) for w, law in zip(touching, laws, strict=True)]
            if any(law["beta"] for law in laws):  # beside which no wall is rough
                push, _, rank, _ = np.linalg.lstsq(pose[touching, 3:6].T, total[i], rcond=1e-9)
                push = push if rank == len(touching) else np.full(len(touching), np.nan)
            left = total[i] - np.array(push) @ pose[touching, 3:6]
            shearing = [w for w, law in zip(touching, laws, strict=True) if carries_shear(law)]
            for w, fn in zip(touching, push, strict=True):
                normal, shear = pose[w, 3:6], np.zeros(3)
                if w in shearing:
                    shear = left - (left @ normal) * normal if len(shearing) == 1 else np.full(3, np.nan)
                found[i, self.n + w] = fn, shear
                loads[w] -= fn * normal + shear
        return loads


def normal_force(law, radius, overlap):
    """Of a wall without dashpot [N]."""
    if law["e_star"]:
        return 4.0 / 3.0 * law["e_star"] * np.sqrt(radius * overlap) * overlap
    return law["kn"] * overlap


def rotation(one, two, turn):
    """Matrix of a rotation by ``turn`` [rad] that takes the normal ``one`` to ``two``: the shortest that does, after the twist about it."""
    angle = float(np.linalg.norm(turn))
    along = float(turn @ one) / angle if angle else 0.0
    twist = 2.0 * math.atan2(math.sin(0.5 * angle) * along, math.cos(0.5 * angle))
    x, y, z = one
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    about = np.eye(3) + math.sin(twist) * across + (1.0 - math.cos(twist)) * across @ across
    both = one + two
    return (np.eye(3) - np.outer(both, both) / (1.0 + one @ two) + 2.0 * np.outer(two, one)) @ about


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
    """A vector of Kratos; a list takes it four times as long to read."""
    return Kratos.Array3([float(value) for value in values])


def block(name, lines):
    """A block of an mdpa file."""
    body = "".join(f"{line}\n" for line in lines)
    return f"Begin {name}\n{body}End {name.split()[0]}\n\n"


def bodies_file(x, radius, kind, element):
    """Bodies as nodes 1..n, with a sub model part for each kind."""
    n = len(x)
    text = HEAD + block("Nodes", (f"{i + 1} {numbers(x[i])}" for i in range(n)))
    text += block(f"Elements {element}", (f"{i + 1} 0 {i + 1}" for i in range(n)))
    text += block("NodalData RADIUS", (f"{i + 1} 0 {number(radius[i])}" for i in range(n)))
    for k in range(max(kind) + 1):
        members = [str(i + 1) for i in range(n) if kind[i] == k]
        parts = block("SubModelPartNodes", members) + block("SubModelPartElements", members)
        text += block(f"SubModelPart kind{k}", [parts])
    return text


def walls_file(walls, condition):
    """Walls as edges or triangles, ``walls`` the corners of each, with a sub model part for each."""
    corners = [corner for wall in walls for corner in wall]
    text = HEAD + block("Nodes", (f"{k + 1} {numbers(corner)}" for k, corner in enumerate(corners)))
    names = [[str(len(wall) * w + k + 1) for k in range(len(wall))] for w, wall in enumerate(walls)]
    text += block(f"Conditions {condition}", (f"{w + 1} 0 {' '.join(own)}" for w, own in enumerate(names)))
    for w, own in enumerate(names):
        data = block("SubModelPartData", [f"IDENTIFIER wall{w}", "FIXED_MESH_OPTION 0", "RIGID_BODY_MOTION 0"])
        nodes = block("SubModelPartNodes", own)
        text += block(f"SubModelPart wall{w}", [data + nodes + block("SubModelPartConditions", [str(w + 1)])])
    return text


def materials(run, densities, first):
    """Materials: the kinds of bodies by density and material, then the walls; relations of bodies among themselves and with each wall.

    ``first`` holds a body of each kind. Beside the linear law Young's modulus only shares the overlap of two bodies between them, and that
    equally where it is the same.
    """
    kinds, walls = len(densities), len(run.walls)
    names = [f"kind{k}" for k in range(kinds)] + [f"wall{w}" for w in range(walls)]
    young = run.elastic or [run.law["kn"]] * (1 + walls)
    own = [{"PARTICLE_DENSITY": density, "YOUNG_MODULUS": young[0]} for density in densities]
    own += [{"COMPUTE_WEAR": False, "YOUNG_MODULUS": modulus} for modulus in young[1:]]
    found = [
        {"material_name": name, "material_id": k + 1, "Variables": {"POISSON_RATIO": 0.0, **each}}
        for k, (name, each) in enumerate(zip(names, own, strict=True))
    ]
    pairs = [(a, b, run.law_of(first[a], first[b])) for a in range(kinds) for b in range(a, kinds)]
    pairs += [(a, kinds + w, run.law_of(first[a], run.n + w)) for a in range(kinds) for w in range(walls)]
    relations = [
        {
            "material_names_list": [names[a], names[b]],
            "material_ids_list": [a + 1, b + 1],
            "Variables": contact(law, run.model),
        }
        for a, b, law in pairs
    ]
    table = [[f"{'SpheresPart' if k < kinds else 'RigidFacePart'}.{name}", name] for k, name in enumerate(names)]
    return json.dumps(
        {"materials": found, "material_relations": relations, "material_assignation_table": table}, allow_nan=False
    )


def contact(law, model):
    """Variables of one relation; a contact without friction or without shear spring carries no shear force."""
    mu = law["mu"] if carries_shear(law) else 0.0
    return {
        "DEM_DISCONTINUUM_CONSTITUTIVE_LAW_NAME": model,
        "K_NORMAL": law["kn"],
        "K_TANGENTIAL": law["ks"] if carries_shear(law) else law["kn"],
        "COEFFICIENT_OF_RESTITUTION": 1.0,  # the dashpot's ratio is set by the driver
        "STATIC_FRICTION": mu,
        "DYNAMIC_FRICTION": mu,
        "FRICTION_DECAY": 500.0,
        "ROLLING_FRICTION": law["rolling"]["mu"] if law["rolling"] else 0.0,
        "ROLLING_FRICTION_WITH_WALLS": law["rolling"]["mu"] if law["rolling"] else 0.0,
        "DEM_ROLLING_FRICTION_MODEL_NAME": ROLLING[law["rolling"]["model"] if law["rolling"] else ""],
    }


def parameters(run):
    """Parameters of the analysis."""
    gravity, tolerance = in_3d(run.gravity).tolist(), SEARCH * float(run.radius.min())
    return json.dumps(
        {
            "problem_name": NAME,
            "Dimension": run.dimension,
            "do_print_results_option": False,
            "dem_inlet_option": False,
            "BoundingBoxOption": False,
            "GravityX": gravity[0],
            "GravityY": gravity[1],
            "GravityZ": gravity[2],
            "solver_settings": {
                "strategy": "sphere_strategy",
                "RemoveBallsInitiallyTouchingWalls": False,
                "model_import_settings": {"input_type": "mdpa", "input_filename": NAME},
                "material_import_settings": {"materials_filename": "MaterialsDEM.json"},
            },
            "RotationOption": True,
            "RollingFrictionOption": any(law["rolling"] for law in run.all_laws),
            "GlobalDamping": 0.0,
            "CleanIndentationsOption": False,
            "DeltaOption": "Absolute",
            "SearchTolerance": tolerance,
            "search_tolerance_against_walls": tolerance,
            "NeighbourSearchFrequency": 1,
            "ContactMeshOption": True,
            "PostRigidElementForces": True,
            "ElementType": ELEMENTS[run.dimension][1],
            "TranslationalIntegrationScheme": "Symplectic_Euler",
            "RotationalIntegrationScheme": "Direct_Integration",
            "AutomaticTimestep": False,
            "MaxTimeStep": run.dt,
            "FinalTime": 1e9 * run.dt,
            "ControlTime": 1e9,
        },
        allow_nan=False,
    )


if __name__ == "__main__":
    serve(Run)
