import pytest
from shapes import ellipsoid_mesh

from gyriflow.io.tetmeshes import write_tetrahedral_mesh


@pytest.fixture(scope="session")
def mesh(tmp_path_factory):
    """The file of an ellipsoid's mesh."""
    path = tmp_path_factory.mktemp("mesh") / "brain.xdmf"
    write_tetrahedral_mesh(path, ellipsoid_mesh(8, (20.0, 26.0, 18.0)))
    return path
