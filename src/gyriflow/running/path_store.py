"""Storage of an atlas' path for other studies: next to the atlas' files, named by everything it depends on."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from ..code_hash import code_hash
from ..settings.stages import MeshSettings
from ..shipped import SHIPPED
from ..study.series import Chain
from ..study.study import Study

PATH_MESH_SETTINGS = MeshSettings(
    order=1, mesher="tetgen", surface_edge_mm=0.95, core_edge_mm=3.0, max_surface_distance_mm=0.5
)
"""The mesh of an atlas' path, the same in all studies: finer ones cost more and carry brains to the same shapes."""
SCRIPTS = ("pial", "register", "match_surfaces", "tetrahedralise", "targets")
"""The scripts that a path is made by."""


def path_store(study: Study, path: Chain, contents: Mapping[str, str]) -> Path | None:
    """Return the file of a path in the folder of the atlas' files; None for other brains.

    Its name has a hash of the contents of the files of all its brains, of the settings of their surfaces, and of the
    code. `contents` are hashes by path (`provenance.input_contents`).
    """
    config, first = study.config, path.brains[0].id
    if not all(brain.id in study.atlases for brain in path.brains):
        return None
    folder = next(used.folder for used in study.used_atlases if used.atlas is study.atlases[first])
    files = [[contents[file] for file in brain.config.files] for brain in path.brains]
    code = [code_hash(SHIPPED / "workflow" / "scripts" / f"{name}.py") for name in SCRIPTS]
    settings = [config.surface.model_dump(mode="json"), PATH_MESH_SETTINGS.model_dump(mode="json"), path.weeks]
    key = hashlib.sha256(json.dumps([files, settings, config.growth.matched_surfaces, code]).encode()).hexdigest()[:12]
    return folder / "paths" / f"{first}-{key}.h5"
