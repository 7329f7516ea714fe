"""Storage of atlases' paths for other studies: next to an atlas' files, named by all
that a path is made from."""

import hashlib
import re
from pathlib import Path
from typing import Any

from ..code_hash import code_hash
from ..errors import InputError
from ..io.registrations import read_path_key, read_weekly_shapes, stored_name
from ..settings.root import Config
from ..shipped import SHIPPED
from ..study.brains import label_source
from ..study.paths import ATLAS_PATH
from ..study.records import Brain, Chain
from ..study.study import Study

RULE_FILES = ("surface", "registration", "mesh")
"""The files with the rules that a path is made by."""
SCRIPT = re.compile(r"scripts/(\w+\.py)")


def path_origin(study: Study, path: Chain) -> dict[str, Any]:
    """Return everything that a path is made from, with the paths of files (see
    `io.origins`).

    This is the description of each of its brains and of each brain whose thickness
    fills one of them, with all files that they name; the settings of surfaces and of
    the mesh; and a hash of the rules and scripts.
    """
    brains = [study.brains[name] for name in path.brains]
    brains += _thickness_sources(study, path)
    return {
        "brains": [_description(study.config, brain) for brain in brains],
        # by matched vertices or by registration
        "correspondences": path.links,
        "surface": study.config.surface.model_dump(mode="json"),
        "mesh": study.config.growth.path_mesh.model_dump(mode="json"),
        "code": _code(),
    }


def _thickness_sources(study: Study, path: Chain) -> list[Brain]:
    """Return the brains whose measured thickness fills the surfaces of a path's brains
    to labels."""
    sources: dict[str, Brain] = {}
    for file in path.links:
        link = study.links[file]
        for name, is_filled in zip(
            (link.earlier, link.later),
            link.posed,
            strict=True,
        ):
            source = study.brains[name].thickness_of
            if is_filled and source is not None:
                sources[source] = study.brains[source]
    return list(sources.values())


def _description(config: Config, brain: Brain) -> dict[str, Any]:
    """Return everything that a study says of a brain, with the meaning of its
    labels."""
    labels = label_source(config, brain)
    return {
        "brain": config.brain(brain.id).model_dump(mode="json"),
        "scheme": labels.scheme.model_dump(mode="json") if labels else None,
    }


def _code() -> str:
    """Return a hash of the rules and scripts that make paths, and of the code behind
    the scripts."""
    workflow = SHIPPED / "workflow"
    rules = [
        (workflow / "rules" / f"{name}.smk").read_text(encoding="utf-8")
        for name in RULE_FILES
    ]
    scripts = [
        workflow / "scripts" / name
        for name in sorted(set(SCRIPT.findall("".join(rules))))
    ]
    texts = [
        *rules,
        *(script.read_text(encoding="utf-8") for script in scripts),
        *map(code_hash, scripts),
    ]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()


def store_folder(study: Study, path: Chain) -> Path | None:
    """Return the folder for a path of an atlas, next to the files of the atlas; None
    for other brains."""
    if not all(study.brains[name].atlas for name in path.brains):
        return None
    return study.atlases[path.brain].folder / "paths"


def kept_path(
    study: Study,
    path: Chain,
    key: str | None,
) -> Path | None:
    """Return the file with the path that an earlier study kept; None if there is none,
    or if it is damaged."""
    folder = store_folder(study, path)
    if folder is None or key is None:
        return None
    store = folder / stored_name(path.brain, key)
    if not store.exists():
        return None
    try:
        shapes = read_weekly_shapes(store)
    except InputError:
        return None
    return store if shapes.made_from == key else None


def has_path(path: Chain, key: str | None) -> bool:
    """Return whether the study in the working directory has a path that was made from
    all that `key` stands for."""
    file = Path(ATLAS_PATH.format(brain=path.brain))
    return key is not None and file.exists() and read_path_key(file) == key
