"""Where contact begins on a mesh: the distance that its edges ask for, and the one that thin triangles leave of it.

    ./run python benchmarks/contact_distance.py MESH [MESH ...]

The distance is a fifth of the mean edge between nodes, but no more than the smallest gap at the start. Pairs within the
former are counted as Incremental Potential Contact has them, and as Offset Geometric Contact does, which leaves out
what lies beside each other on one surface. One line of JSON for each mesh.
"""

import argparse
import json
from pathlib import Path

import ipctk
import numpy as np
from mpi4py import MPI

from gyriflow.folding.contact import ContactSettings, SelfContact, new_pairs
from gyriflow.folding.domain import Domain
from gyriflow.geometry.tetrahedra import boundary_faces
from gyriflow.io.tetmeshes import read_tetrahedral_mesh


def measure(file: Path) -> dict:
    """Returns what there is to say of a mesh."""
    mesh = read_tetrahedral_mesh(file)
    domain = Domain(MPI.COMM_SELF, mesh)
    nowhere = np.zeros((len(domain.vertex_of_node), 3))
    contact = SelfContact(domain, nowhere, boundary_faces(mesh)[0], ContactSettings(150.0))
    asked = contact._distance_of_edges()
    surface, places = contact._surface, contact._start
    surface.init_adjacencies()
    found = {"order": mesh.order, "unknowns": 3 * len(mesh.vertices), "triangles": len(surface.faces)}
    found |= {"asked_mm": round(asked, 4), "begins_mm": round(contact.distance_mm, 4)}
    for name, kind in (("ipc", ipctk.NormalCollisions.IPC), ("ogc", ipctk.NormalCollisions.OGC)):
        pairs = new_pairs()
        pairs.collision_set_type = kind
        pairs.build(surface, places, asked, broad_phase=ipctk.LBVH())
        found[f"pairs_{name}"] = len(pairs)
        if len(pairs):
            found[f"nearest_{name}_mm"] = round(float(np.sqrt(pairs.compute_minimum_distance(surface, places))), 4)
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path)
    for mesh in parser.parse_args().meshes:
        print(json.dumps(measure(mesh)), flush=True)
