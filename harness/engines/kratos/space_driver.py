"""Spheres in space in Kratos DEM: the scheme and the linear law of the plane's driver, planes as one triangle each, moved by its nodes.

Kratos keeps the sum of the forces of walls on a sphere. Where no plane has a dashpot, normal forces follow from overlaps; what is left is
the shear force of the one rough plane, and of several it is not observed. Planes with dashpots are all smooth: their normal forces are what
the sum is made of, where that is so in one way only.

Without friction there is Hertz' law, too: of materials with nu = 0, whose moduli give each contact its E*.
"""

import json
import math
from importlib import metadata

import KratosMultiphysics as Kratos
import numpy as np
from driver import HEAD, LAW, NAME, SEARCH, Nodes, block, contact, parameters
from driver_parts import clock, number
from KratosMultiphysics import DEMApplication as Dem
from KratosMultiphysics.DEMApplication.DEM_analysis_stage import DEMAnalysisStage
from space_parts import SpaceRun, rough

HERTZ = "DEM_D_Hertz_viscous_Coulomb"


class Run(SpaceRun):
    """One simulation."""

    name = "Kratos"

    def __init__(self, request):
        super().__init__(request)
        self.reach, self.time = request["extra"]["reach"], 0.0
        self.elastic = request["extra"]["elastic"]  # Young's modulus of the spheres, then of each wall
        self.model = {"DEM_DISCONTINUUM_CONSTITUTIVE_LAW_NAME": HERTZ if self.elastic else LAW}
        self.middle = 0.5 * (self.x0.min(axis=0) + self.x0.max(axis=0))
        self.corners = [self._corners(row) for row in self.path[0]]
        self._build()

    def version(self):
        return metadata.version("KratosDEMApplication")

    def settings(self):
        return {
            "contact law": self.model["DEM_DISCONTINUUM_CONSTITUTIVE_LAW_NAME"],
            "triangle's inradius [m]": self.reach,
        }

    def _build(self):
        # A material for each sphere's density; laws are those of all spheres, and of each plane.
        density = self.mass / (4.0 / 3.0 * np.pi * self.radius**3)
        kinds, kind = np.unique(density, return_inverse=True)
        files = {
            f"{NAME}DEM.mdpa": spheres_file(self.x0, self.radius, kind.reshape(-1).tolist()),
            f"{NAME}DEM_FEM_boundary.mdpa": planes_file(self.corners),
            "MaterialsDEM.json": materials(self, kinds.tolist()),
        }
        for name, text in files.items():
            with open(name, "w", encoding="ascii") as file:
                file.write(text)
        Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
        text = parameters(self.dt, self.gravity.tolist(), SEARCH * float(self.radius.min()), False, 3)
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
        faces = self.stage.rigid_face_model_part
        self.wall_nodes = Nodes(
            node
            for w in range(len(self.walls))
            for node in sorted(faces.GetSubModelPart(f"wall{w}").Nodes, key=lambda node: node.Id)
        )
        # Hertz' dashpot here is 2 gamma sqrt(m S), with the tangent stiffness S.
        share = math.sqrt(5.0 / 6.0) if self.elastic else 1.0
        for properties in self.part.Properties:
            for pair in properties.GetSubProperties():
                wall = max(properties.Id, pair.Id) - len(kinds) - 1
                pair[Dem.DAMPING_GAMMA] = share * (self.law if wall < 0 else self.walls[wall]["law"])["beta"]
        for i, node in enumerate(self.nodes):
            node.SetSolutionStepValue(Kratos.NODAL_MASS, float(self.mass[i]))
            node.SetSolutionStepValue(Dem.PARTICLE_MOMENT_OF_INERTIA, float(self.inertia[i]))

    def _corners(self, row):
        """Of the triangle that stands for a plane, about the foot of the spheres' middle; the normal is that of their order."""
        point, normal = row[0:3], row[3:6]
        foot = self.middle - ((self.middle - point) @ normal) * normal
        one = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        one /= np.linalg.norm(one)
        two = np.cross(normal, one)
        return [foot + 2.0 * self.reach * (np.cos(a) * one + np.sin(a) * two) for a in 2.0 * np.pi / 3.0 * np.arange(3)]

    def _place_walls(self, step):
        """Put the triangles, material points of planes, where these are at a contact step, with what they moved by in it."""
        if step > len(self.path) or not self.walls:
            return  # at rest, and known to Kratos as such
        here, there = self.pose(max(step - 1, 0)), self.pose(step)
        displacement, velocity = np.zeros((2, len(self.corners), 3, 3))
        for w, corners in enumerate(self.corners):
            turned = rotation(here[w, 3:6], there[w, 3:6], self.dt * there[w, 9:12])
            for k, corner in enumerate(corners):
                new = there[w, 0:3] + turned @ (corner - here[w, 0:3])
                displacement[w, k] = new - corner
                velocity[w, k] = there[w, 6:9] + np.cross(there[w, 9:12], new - there[w, 0:3])
                corners[k] = new
        self.wall_nodes.move(np.array(self.corners))
        self.wall_nodes.write(Dem.DELTA_DISPLACEMENT, displacement)
        self.wall_nodes.write(Kratos.VELOCITY, velocity)

    def start(self):
        """Initial velocities."""
        for i, node in enumerate(self.nodes):
            node.SetSolutionStepValue(Kratos.VELOCITY, vector(self.v0[i]))
            node.SetSolutionStepValue(Kratos.ANGULAR_VELOCITY, vector(self.omega0[i]))
        self.angle = np.zeros((self.n, 3))

    def read(self, variable):
        """A vector variable of all spheres, shape (n, 3)."""
        return self.all_nodes.read(variable)

    def advance(self, sampled):
        """All steps; returns the seconds that are not spent on samples, see `clock`."""
        wanted, last = {step * self.substeps for step in sampled}, max(sampled) * self.substeps
        spent, begin = 0.0, clock()
        for step in range(last + 1):
            sampling = step in wanted
            if sampling:
                before = self.state()
            self._place_walls(step)
            self._step(sampling)
            if step == 0:
                self._correct_start()
            if sampling:
                spent += clock() - begin
                self._sample(step, *before)
                begin = clock()
            self.angle = self.angle + self.dt * self.read(Kratos.ANGULAR_VELOCITY)
        return spent + clock() - begin

    def _step(self, sampling):
        self.time += self.dt
        for part in self.parts:
            self.tell_time(part, self.time, self.dt, sampling)
        self.strategy.ResetPrescribedMotionFlagsRespectingImposedDofs()
        self.strategy.InitializeSolutionStep()
        self.strategy.SolveSolutionStep()
        self.strategy.FinalizeSolutionStep()

    def _correct_start(self):
        """From ``v_0 + dt F_0/m`` to ``v_{1/2}``; the spheres and their turns follow."""
        dt, v, w = self.dt, self.read(Kratos.VELOCITY), self.read(Kratos.ANGULAR_VELOCITY)
        half, spin = self.v0 + 0.5 * (v - self.v0), self.omega0 + 0.5 * (w - self.omega0)
        for i, node in enumerate(self.nodes):
            displacement = dt * half[i]
            node.X, node.Y, node.Z = (float(c) for c in self.x0[i] + displacement)
            for name in (Dem.DELTA_DISPLACEMENT, Kratos.DISPLACEMENT):
                node.SetSolutionStepValue(name, vector(displacement))
            for name in (Kratos.DELTA_ROTATION, Dem.PARTICLE_ROTATION_ANGLE):
                node.SetSolutionStepValue(name, vector(dt * spin[i]))
            node.SetSolutionStepValue(Kratos.VELOCITY, vector(half[i]))
            node.SetSolutionStepValue(Kratos.ANGULAR_VELOCITY, vector(spin[i]))

    def state(self):
        """Positions [m], velocities [m/s] and spins [rad/s] that Kratos holds."""
        return self.all_nodes.places(), self.read(Kratos.VELOCITY), self.read(Kratos.ANGULAR_VELOCITY)

    def _sample(self, step, x, v, omega):
        """State at ``t_n``: positions and angles before the step, mean velocities, the forces that the step has computed."""
        _, after, spun = self.state()
        found, loads = self._pairs(x), np.zeros((len(self.walls), 3))
        total = -self.read(Dem.RIGID_ELEMENT_FORCE)
        pose = self.pose(step)
        for i in range(self.n):
            overlap = self.radius[i] - np.einsum("wc,wc->w", x[i] - pose[:, 0:3], pose[:, 3:6])
            touching = np.flatnonzero(overlap > 0.0).tolist()
            if not touching:
                continue
            laws = [self.law_of(i, self.n + w) for w in touching]
            push = [normal_force(law, self.radius[i], float(overlap[w])) for w, law in zip(touching, laws, strict=True)]
            if any(law["beta"] for law in laws):  # beside which no plane is rough
                push, _, rank, _ = np.linalg.lstsq(pose[touching, 3:6].T, total[i], rcond=1e-9)
                push = push if rank == len(touching) else np.full(len(touching), np.nan)
            left = total[i] - np.array(push) @ pose[touching, 3:6]
            shearing = [w for w in touching if rough(self.law_of(i, self.n + w))]
            unknown = np.full(3, np.nan)  # of several
            for w, fn in zip(touching, push, strict=True):
                normal = pose[w, 3:6]
                shear = (
                    left - (left @ normal) * normal if [w] == shearing else unknown if w in shearing else np.zeros(3)
                )
                found[i, self.n + w] = fn, shear
                loads[w] -= fn * normal + shear
        if step:
            v, omega = 0.5 * (v + after), 0.5 * (omega + spun)
        else:
            v, omega = self.v0, self.omega0
        self.sample(step // self.substeps, x, v, omega, self.angle.copy(), found, loads)

    def _pairs(self, x):
        """Touching pairs of spheres: ``{(i, j): (fn, fs)}``, forces as Kratos keeps them."""
        self.solver.PrepareContactElementsForPrinting()
        found = {}
        for element in self.stage.contact_model_part.Elements:
            one, two = (self.numbers[node.Id] for node in element.GetNodes())
            i, j = min(one, two), max(one, two)
            d = x[j] - x[i]
            distance = float(np.linalg.norm(d))
            if distance < self.radius[i] + self.radius[j]:
                force = element.GetValue(Dem.GLOBAL_CONTACT_FORCE)
                force = np.array((force[0], force[1], force[2]))
                force = -force if one > two else force
                normal = d / distance
                fn = float(-force @ normal)
                found[i, j] = fn, force + fn * normal
        return found


def normal_force(law, radius, overlap):
    """Of a plane without dashpot [N]."""
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


def vector(values):
    """A vector of Kratos."""
    return Kratos.Array3([float(value) for value in values])


def spheres_file(x, radius, kind):
    """Spheres as nodes 1..n, with a sub model part for each kind."""
    n = len(x)
    text = HEAD + block("Nodes", (f"{i + 1} {' '.join(map(number, x[i]))}" for i in range(n)))
    text += block("Elements SphericParticle3D", (f"{i + 1} 0 {i + 1}" for i in range(n)))
    text += block("NodalData RADIUS", (f"{i + 1} 0 {number(radius[i])}" for i in range(n)))
    for k in range(max(kind) + 1):
        members = [str(i + 1) for i in range(n) if kind[i] == k]
        text += block(
            f"SubModelPart kind{k}", [block("SubModelPartNodes", members) + block("SubModelPartElements", members)]
        )
    return text


def planes_file(triangles):
    """Planes as triangles, with a sub model part for each."""
    corners = [corner for triangle in triangles for corner in triangle]
    text = HEAD + block("Nodes", (f"{k + 1} {' '.join(map(number, corner))}" for k, corner in enumerate(corners)))
    text += block(
        "Conditions RigidFace3D3N", (f"{w + 1} 0 {3 * w + 1} {3 * w + 2} {3 * w + 3}" for w in range(len(triangles)))
    )
    for w in range(len(triangles)):
        data = block("SubModelPartData", [f"IDENTIFIER wall{w}", "FIXED_MESH_OPTION 0", "RIGID_BODY_MOTION 0"])
        nodes = block("SubModelPartNodes", [str(3 * w + k) for k in (1, 2, 3)])
        text += block(f"SubModelPart wall{w}", [data + nodes + block("SubModelPartConditions", [str(w + 1)])])
    return text


def materials(run, densities):
    """Materials: the spheres by density, then the walls; relations of spheres among themselves and with each wall."""
    names = [f"kind{k}" for k in range(len(densities))] + [f"wall{w}" for w in range(len(run.walls))]
    young = run.elastic or [run.law["kn"]] * (1 + len(run.walls))
    own = [{"PARTICLE_DENSITY": density, "YOUNG_MODULUS": young[0]} for density in densities]
    own += [{"COMPUTE_WEAR": False, "YOUNG_MODULUS": modulus} for modulus in young[1:]]
    found = [
        {"material_name": name, "material_id": k + 1, "Variables": {"POISSON_RATIO": 0.0, **each}}
        for k, (name, each) in enumerate(zip(names, own, strict=True))
    ]
    kinds = range(len(densities))
    pairs = [(a, b, run.law) for a in kinds for b in kinds if a <= b]
    pairs += [(a, len(densities) + w, wall["law"]) for a in kinds for w, wall in enumerate(run.walls)]
    relations = [
        {
            "material_names_list": [names[a], names[b]],
            "material_ids_list": [a + 1, b + 1],
            "Variables": contact(law) | run.model,
        }
        for a, b, law in pairs
    ]
    table = [
        [f"SpheresPart.{name}" if k < len(densities) else f"RigidFacePart.{name}", name] for k, name in enumerate(names)
    ]
    return json.dumps(
        {"materials": found, "material_relations": relations, "material_assignation_table": table}, allow_nan=False
    )
