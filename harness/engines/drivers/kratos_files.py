"""The input files of Kratos DEM: disks, walls, materials, settings. Plain text, nothing of Kratos."""

import json

LAW = "DEM_D_Linear_Custom_Constants"
"""Linear springs and dashpot without tension, Coulomb friction; stiffnesses given pair by pair, whatever Young's modulus."""

NAME = "scene"
HEAD = "Begin ModelPartData\nEnd ModelPartData\n\nBegin Properties 0\nEnd Properties\n\n"


def number(value):
    """Shortest text that gives the same double back."""
    return repr(float(value))


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


def materials(densities, law, walls):
    """Materials: the kinds of disks by density, then the walls; relations of disks among themselves and with each wall."""
    kinds = len(densities)
    names = [f"kind{k}" for k in range(kinds)] + [f"wall{w}" for w in range(len(walls))]
    # Young's modulus only shares the overlap of two disks between them, and that equally where it is the same.
    common = {"YOUNG_MODULUS": law["kn"], "POISSON_RATIO": 0.0}
    found = [
        {"material_name": name, "material_id": k + 1, "Variables": {**common, **own}}
        for k, (name, own) in enumerate(
            zip(
                names,
                [{"PARTICLE_DENSITY": density} for density in densities] + [{"COMPUTE_WEAR": False}] * len(walls),
                strict=True,
            )
        )
    ]
    pairs = [(a, b, law) for a in range(kinds) for b in range(a, kinds)]
    pairs += [(a, kinds + w, wall) for a in range(kinds) for w, wall in enumerate(walls)]
    relations = [
        {
            "material_names_list": [names[a], names[b]],
            "material_ids_list": [a + 1, b + 1],
            "Variables": contact(pair_law),
        }
        for a, b, pair_law in pairs
    ]
    table = [[f"SpheresPart.kind{k}", f"kind{k}"] for k in range(kinds)]
    table += [[f"RigidFacePart.wall{w}", f"wall{w}"] for w in range(len(walls))]
    return json.dumps(
        {"materials": found, "material_relations": relations, "material_assignation_table": table}, allow_nan=False
    )


def contact(law):
    """Variables of one relation; a contact without friction or without shear spring carries no shear force."""
    rough = law["mu"] > 0.0 and law["ks"] > 0.0
    mu = law["mu"] if rough else 0.0
    return {
        "DEM_DISCONTINUUM_CONSTITUTIVE_LAW_NAME": LAW,
        "K_NORMAL": law["kn"],
        "K_TANGENTIAL": law["ks"] if rough else law["kn"],
        "COEFFICIENT_OF_RESTITUTION": 1.0,  # the dashpot's ratio is set by the driver
        "STATIC_FRICTION": mu,
        "DYNAMIC_FRICTION": mu,
        "FRICTION_DECAY": 500.0,
        "ROLLING_FRICTION": 0.0,
        "ROLLING_FRICTION_WITH_WALLS": 0.0,
        "DEM_ROLLING_FRICTION_MODEL_NAME": "DEMRollingFrictionModelBounded",
    }


def settings(dt, gravity, tolerance):
    """Parameters of the analysis."""
    return json.dumps(
        {
            "problem_name": NAME,
            "Dimension": 2,
            "do_print_results_option": False,
            "dem_inlet_option": False,
            "BoundingBoxOption": False,
            "GravityX": gravity[0],
            "GravityY": gravity[1],
            "GravityZ": 0.0,
            "solver_settings": {
                "strategy": "sphere_strategy",
                "RemoveBallsInitiallyTouchingWalls": False,
                "model_import_settings": {"input_type": "mdpa", "input_filename": NAME},
                "material_import_settings": {"materials_filename": "MaterialsDEM.json"},
            },
            "RotationOption": True,
            "RollingFrictionOption": False,
            "GlobalDamping": 0.0,
            "CleanIndentationsOption": False,
            "DeltaOption": "Absolute",
            "SearchTolerance": tolerance,
            "search_tolerance_against_walls": tolerance,
            "NeighbourSearchFrequency": 1,
            "ContactMeshOption": True,
            "PostRigidElementForces": True,
            "ElementType": "CylinderPartDEMElement2D",
            "TranslationalIntegrationScheme": "Symplectic_Euler",
            "RotationalIntegrationScheme": "Direct_Integration",
            "AutomaticTimestep": False,
            "MaxTimeStep": dt,
            "FinalTime": 1e9 * dt,
            "ControlTime": 1e9,
        },
        allow_nan=False,
    )
