"""The label schemes that come with gyriflow, each a file of the folder `schemes`."""

from collections.abc import Iterator, Mapping

from ..parameters.schemes import SCHEME_FILES, LabelScheme, SchemeSettings
from ..parameters.settings import validated
from .yaml_files import read_keys


class Schemes(Mapping[str, LabelScheme]):
    """The schemes by name, each read when it is first asked for; InputError where a file is no scheme."""

    def __init__(self) -> None:
        self._known: dict[str, LabelScheme] = {}

    def __getitem__(self, name: str) -> LabelScheme:
        if name not in self._known:
            path = SCHEME_FILES[name]
            settings = validated(SchemeSettings, read_keys(path), str(path))
            self._known[name] = LabelScheme(name=name, **settings.model_dump())
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(SCHEME_FILES)

    def __len__(self) -> int:
        return len(SCHEME_FILES)


SCHEMES = Schemes()
"""A further scheme is a further file."""
