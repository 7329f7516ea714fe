"""The parameters of a run from the content of its `params.yaml`, and checks of its maps."""

from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from .folding import FoldingParameters, value_problems
from .messages import line, messages
from .varying import Maps


def parameters_from(values: Any) -> FoldingParameters:
    """Returns the parameters from nested mappings as read from YAML; numbers written as 2e-7 are understood.

    Raises
    ------
    InputError
        Naming all problems at once.
    """
    try:
        return FoldingParameters.model_validate(values)
    except ValidationError as error:
        found = [line(*problem) for problem in messages(error, FoldingParameters)]
        raise InputError("folding parameters: " + "; ".join(found)) from None


def require_maps(p: FoldingParameters, maps: Maps, vertices: int) -> None:
    """Raises InputError where a map is missing, does not fit the mesh, or holds impossible values."""
    for name in sorted(p.maps):
        if name not in maps:
            raise InputError(f"the map {name} is missing", expected="a file with it, given with --maps")
        found = maps[name].shape
        if found != (vertices,):
            raise InputError(f"the map {name} does not fit the mesh", found=found, expected=f"{vertices} values")
    problems = [line(problem.key, problem.text) for problem in value_problems(p, p.start_week, maps)]
    if problems:
        raise InputError("folding parameters: " + "; ".join(problems))
