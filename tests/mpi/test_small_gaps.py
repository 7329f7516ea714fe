"""Bodies with gaps far smaller than an edge are made without reading freed memory."""

import os
import sys

from processes import ran

MAKE_BODIES = """
from contact_bodies import vertices_pulled_near
for gap_mm in (0.5, 0.03):
    vertices_pulled_near(gap_mm, 2)
"""
OVERWRITE_FREED_MEMORY = {
    "GLIBC_TUNABLES": "glibc.malloc.tcache_count=0",
    "MALLOC_PERTURB_": "165",
}
"""With these settings glibc overwrites memory as soon as it is freed, so that reading
it ends the process."""


def test_bodies_with_small_gaps_are_made_where_freed_memory_is_overwritten():
    environment = (
        os.environ | OVERWRITE_FREED_MEMORY | {"PYTHONPATH": os.pathsep.join(sys.path)}
    )
    done = ran(sys.executable, "-c", MAKE_BODIES, env=environment)
    assert done.returncode == 0, done.stderr[-2000:]
