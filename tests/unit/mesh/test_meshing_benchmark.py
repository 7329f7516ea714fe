"""The benchmark of meshing, on a small ball."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.surfaces import write_surface

BENCHMARK = Path(__file__).parents[3] / "benchmarks" / "meshing.py"


def test_the_last_line_tells_size_quality_and_distance(tmp_path):
    shape = trimesh.creation.icosphere(subdivisions=4, radius=8.0)
    write_surface(tmp_path / "ball.stl", TriangleMesh(shape.vertices, shape.faces))
    options = ["--mesher", "tetgen", "--pial-faces", "3000", "--thickness-mm", "2"]
    done = subprocess.run(
        [sys.executable, str(BENCHMARK), str(tmp_path / "ball.stl"), *options],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["mesher"] == "tetgen"
    assert found["pial_faces"] == pytest.approx(3000, rel=0.03)
    assert found["vertices"] < found["tets"] < 20 * found["pial_faces"]
    assert found["volume_mm3"] == pytest.approx(4 / 3 * 3.14159 * 8**3, rel=0.01)
    assert found["pial_edge_mm"] == pytest.approx(0.79, rel=0.1)
    # edges in the outer 2 mm are longer than those of the surface, but not by twice
    assert 1.2 < found["elements_through_cortex"] < 2 / found["pial_edge_mm"]
    assert 0 <= found["hausdorff99_mm"] <= found["hausdorff_mm"] < 0.1
    assert found["crossing_faces"] == 0
    assert 0.02 < found["min_radius_ratio"] < found["median_radius_ratio"] < 1
    assert found["cpu_seconds"] > 0
