"""The memory that a folding run is likely to take: plain arithmetic, without MPI or dolfinx."""

MIB_PER_RANK = 250.0
KIB_PER_TET = {1: 0.9, 2: 21.9}
KIB_PER_TET_AND_RANK = {1: 1.6, 2: 7.3}
"""Peak memory of a solve by the order of its elements: a part of the mesh, and positions and searches on every rank.
From runs of 60 k to 1 M linear elements, met within 10 %, and of 23 k to 55 k quadratic ones, met within 5 %, on one
rank and on two (docs/benchmarks.md)."""
GLOBAL_CONTACT = {1: 1.3, 2: 1.0}
"""Factor on what the elements take, where folds press on each other up to 36 GW; not measured with quadratic ones."""
MIB_PER_RANK_OF_CONTACT = {1: 0.0, 2: 180.0}
"""What every rank takes for the search between the flat pieces of curved faces."""


def predicted_memory_mib(tets: int, ranks: int, contact: str, order: int = 1) -> float:
    """Return the peak memory in MiB, over all ranks, that a run with elements of an order is likely to take."""
    per_tet = KIB_PER_TET[order] + KIB_PER_TET_AND_RANK[order] * ranks
    factor, per_rank = (GLOBAL_CONTACT[order], MIB_PER_RANK_OF_CONTACT[order]) if contact == "global" else (1.0, 0.0)
    return (MIB_PER_RANK + per_rank) * ranks + per_tet * factor * tets / 1024
