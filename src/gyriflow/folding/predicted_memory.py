"""The memory that a folding run is likely to take: plain arithmetic, without MPI or dolfinx."""

MIB_PER_RANK = 275.0
KIB_PER_TET = {1: 0.9, 2: 15.5}
KIB_PER_TET_AND_RANK = {1: 0.45, 2: 0.0}
"""Peak memory of a solve by the order of its elements: a part of the mesh, and positions and searches on every rank.
From runs of 183 k to 499 k linear elements to 29 and 30 GW, and of 24 k and 35 k quadratic ones, on one rank and on
two, met within 15 % (`summary.json`)."""
GLOBAL_CONTACT = 1.15
"""Factor on what the elements take; growth towards shapes is in it."""


def predicted_memory_mib(tets: int, ranks: int, contact: str, order: int = 1) -> float:
    """Return the peak memory in MiB, over all ranks, that a run with elements of an order is likely to take."""
    per_tet = KIB_PER_TET[order] + KIB_PER_TET_AND_RANK[order] * ranks
    return MIB_PER_RANK * ranks + per_tet * (GLOBAL_CONTACT if contact == "global" else 1.0) * tets / 1024
