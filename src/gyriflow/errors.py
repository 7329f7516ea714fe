"""Errors that a user can act on, each with the exit code of the program that ends in
it."""

from os import PathLike


class GyriflowError(Exception):
    """An error with a problem (a short clause), the file concerned, what was found and
    expected, and a remedy."""

    exit_code = 1

    def __init__(
        self,
        problem: str,
        *,
        path: str | PathLike[str] | None = None,
        found: object = None,
        expected: object = None,
        remedy: str | None = None,
    ) -> None:
        message = f"{path}: {problem}" if path is not None else problem
        message += f"; found {found}" if found is not None else ""
        message += f"; expected {expected}" if expected is not None else ""
        super().__init__(message + (f". {remedy}" if remedy is not None else ""))
        self.names_file = path is not None

    def __reduce__(self) -> tuple:
        # keyword-only arguments are already part of the message
        return (type(self), (str(self),))


class InputError(GyriflowError):
    """A file or a configuration that cannot be used."""

    exit_code = 2


class MeshError(GyriflowError):
    """A surface or a mesh that cannot be repaired."""

    exit_code = 3


class SolverError(GyriflowError):
    """A folding solve that cannot go on."""

    exit_code = 4


class StorageError(GyriflowError):
    """A file that cannot be written, a disk that is full, a folder in use."""

    exit_code = 5
