"""Prediction of a folding run's memory; imports neither MPI nor dolfinx."""

MIB_PER_RANK = 275.0
KIB_PER_TET = {1: 0.9, 2: 15.5}
KIB_PER_TET_AND_RANK = {1: 0.45, 2: 0.0}
"""Peak memory of a solve by the order of its elements: once for the mesh, and on each
rank for positions and searches. Fitted to runs with 183 k to 499 k linear elements to
29 and 30 GW, and with 24 k and 35 k quadratic ones, on one and two ranks, within 15 %
(`summary.json`)."""
GLOBAL_CONTACT = 1.15
"""Factor on the memory per element; includes growth towards shapes."""


def predicted_memory_mib(
    tets: int,
    ranks: int,
    contact: str,
    order: int = 1,
) -> float:
    """Return the likely peak memory in MiB of a run with elements of an order, over all
    ranks."""
    kib_per_tet = KIB_PER_TET[order] + KIB_PER_TET_AND_RANK[order] * ranks
    if contact == "global":
        kib_per_tet *= GLOBAL_CONTACT
    return MIB_PER_RANK * ranks + kib_per_tet * tets / 1024
