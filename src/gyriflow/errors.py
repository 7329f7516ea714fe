"""Errors that a user can act on, each with the exit code of the program that ends in
it."""

from os import PathLike
from typing import Any


class GyriflowError(Exception):
    """An error with a problem (a short clause), the file concerned, what was found and
    expected, and a remedy.

    `facts` are the last four as text, as far as they are known, by the names of the
    fields of `messages.Message`.
    """

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
        facts = {
            "file": path,
            "found": found,
            "expected": expected,
            "remedy": remedy,
        }
        self.problem = problem
        self.facts: dict[str, Any] = {}
        for name, fact in facts.items():
            if fact is not None:
                self.facts[name] = str(fact)


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
