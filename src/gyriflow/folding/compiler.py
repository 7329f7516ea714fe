"""Choice of the C compiler for forms and C code; imports neither MPI nor dolfinx."""

import importlib.util
import os
import shutil
import sys
import sysconfig


def has_compiler() -> bool:
    """Return whether there is a C compiler: $CC, the one that Python was built with, or
    ziglang from PyPI."""
    return _has_system_compiler() or _has_ziglang()


def set_compiler() -> None:
    """Have Python's build tools use ziglang if the system has no compiler."""
    if not _has_system_compiler() and _has_ziglang():
        command = f"{sys.executable} -m ziglang cc"
        os.environ["CC"] = command
        os.environ["LDSHARED"] = f"{command} -shared"


def _has_system_compiler() -> bool:
    command = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    return shutil.which(command.split()[0]) is not None


def _has_ziglang() -> bool:
    return importlib.util.find_spec("ziglang") is not None
