"""./run itself: what it executes, what it hands on, and that its set-up can be
interrupted. No environment is made."""

import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest
from facts import Facts
from processes import command_of, ran

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
RUN = ROOT / "run"

PYTHON = r"""#!/bin/bash
# stands in for Python 3.13: notes its arguments, makes a venv that holds itself and
# one program
echo "$*" >> "$RECORD"
# a real one finds no modules there
if [ -n "${PYTHONHOME:-}" ]; then exit 1; fi
case "$*" in
    *version_info*) echo 3.13 ;;
    *ensurepip*)
        if [ -e "$RECORD.no-ensurepip" ]; then exit 1; fi ;;
    "-I -m venv "*)
        if [ -e "$4" ]; then echo "something was left behind"; exit 1; fi
        mkdir -p "$4/bin"
        cp "$0" "$4/bin/python"
        printf '#!/bin/sh\necho "from the environment: $*"\n' > "$4/bin/tool"
        chmod +x "$4/bin/tool" ;;
    *gyriflow.running.requirements*)
        if [ -e "$RECORD.missing" ]; then cat "$RECORD.missing"; fi ;;
    *"pip install"*)
        if [ -e "$RECORD.fails" ]; then
            echo "ConnectionError: no such thing"
            exit 1
        fi
        sleep "${SECONDS_TO_CREATE:-0}"
        while [ -e "$RECORD.wait" ]; do sleep 0.05; done ;;
esac
"""

CONDA = r"""#!/bin/bash
# stands in for conda or micromamba: notes its arguments, makes an environment that
# holds one program
echo "$*" >> "$RECORD"
case "$*" in
    *hook*)
        name=$(basename "$0")
        echo "$name() { export CONDA_PREFIX=\$2; export PATH=\$2/bin:\$PATH; }" ;;
    *create*)
        while [ "$1" != -p ]; do shift; done
        mkdir -p "$2/bin"
        printf '#!/bin/sh\necho "from the environment: $*"\n' > "$2/bin/tool"
        chmod +x "$2/bin/tool" ;;
esac
"""

SHIM = """#!/bin/sh
echo "pyenv: $(basename "$0"): command not found" >&2
exit 127
"""
APT_GET = r"""#!/bin/sh
# stands in for apt-get of Debian: notes its arguments, knows two sources of packages
echo "apt-get $*" >> "$RECORD"
case "$*" in
    *indextargets*)
        format=$(echo "$3" | sed 's/\$(ORIGIN)/Debian/')
        echo "$format" | sed 's/\$(LABEL)/Debian-Security/; s/\$(REPO_URI)/security/'
        echo "$format" | sed 's/\$(LABEL)/Debian/; s/\$(REPO_URI)/mirror/' ;;
    *install*)
        rm -f "$RECORD.no-ensurepip"
        sleep "${SECONDS_TO_INSTALL:-0}"
        echo "installed" >> "$RECORD" ;;
esac
"""
OLD_GLIBC = "#!/bin/sh\necho glibc 2.34\n"
ARM = '#!/bin/sh\n[ "$1" = -m ] && echo aarch64 || echo Linux\n'
NOTE_AND_FAIL = '#!/bin/sh\necho "$*" >> "$RECORD"\nexit 1\n'
FAIL = "#!/bin/sh\nexit 1\n"
USER, SUPERUSER = "#!/bin/sh\necho 1000\n", "#!/bin/sh\necho 0\n"
MADE = "from the environment: {}\n".format


def write_program(folder, name, text):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)
    (folder / name).chmod(0o755)


@pytest.fixture
def programs(tmp_path):
    """Return a function that puts programs in front of all others."""

    def put(**texts):
        for name, text in texts.items():
            write_program(tmp_path / "programs", name.replace("_", "-"), text)

    return put


@pytest.fixture
def outside(programs, tmp_path):
    """Return the variables of a shell outside of any environment, with a stand-in for
    Python 3.13 first on PATH."""
    shims = dict.fromkeys(("python3", "python3.12", "python3.14"), SHIM)
    programs(**shims, **{"python3.13": PYTHON})
    active = {"VIRTUAL_ENV", "CONDA_PREFIX"}
    env = {name: value for name, value in os.environ.items() if name not in active}
    files = {
        "GYRIFLOW_CACHE": str(tmp_path / "cache"),
        "RECORD": str(tmp_path / "record"),
        "PYENV_ROOT": str(tmp_path / "pyenv"),
    }
    return env | files | {"PATH": f"{tmp_path / 'programs'}:{env['PATH']}"}


@pytest.fixture
def bare(outside, tmp_path):
    """Return such variables for a machine with no programs but those of the system."""
    return outside | {"PATH": f"{tmp_path / 'programs'}:/usr/bin:/bin"}


@pytest.fixture
def root_on_debian(bare, programs):
    """Return such variables for root on a Debian machine."""
    programs(id=SUPERUSER, dpkg="#!/bin/sh\n", apt_get=APT_GET)
    return bare


OWN = f"9{os.getpid()}.25"
"""Seconds to sleep by which the processes of these tests are told from all others."""


def run(*command, env=None):
    return ran(RUN, *command, env=env, timeout_s=60)


def start(*command, env, process_group=None):
    """Start ./run with signals as a shell starts it, whatever they are here."""
    return subprocess.Popen(
        [RUN, *command],
        env=env,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=process_group,
        preexec_fn=lambda: [
            signal.signal(s, signal.SIG_DFL) for s in (signal.SIGINT, signal.SIGTERM)
        ],
    )


def wait_until(condition, seconds=20.0):
    """Return whether a condition came true in time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False


def running(word):
    """Return the processes that have a word in their command line."""
    pids = [int(process.name) for process in Path("/proc").glob("[0-9]*")]
    return [
        pid
        for pid in pids
        if pid != os.getpid() and any(word in part for part in command_of(pid))
    ]


# --- inside an environment ---------------------------------------------------------


def test_arguments_and_exit_code_are_handed_on():
    given = "a b", "", "*", "$HOME", "'"
    assert run("printf", "%s|", *given).stdout == "a b||*|$HOME|'|"
    assert run("bash", "-c", "exit 7").returncode == 7
    assert run("no-such-command").returncode == 127


def test_blas_is_an_optimised_one():
    program = "import gyriflow.folding, petsc4py.PETSc; print(open('{}').read())"
    loaded = run("python", "-c", program.format("/proc/self/maps")).stdout
    assert "openblas" in loaded or "mkl" in loaded


PETSC = """
class ScalarType({scalar}): pass
class Vec:
    local_size = 2
    def createMPI(self, size, comm): return self
"""
OPEN_MPI = "raise ImportError('libpetsc.so: undefined symbol: ompi_mpi_comm_world')"


REAL = PETSC.format(scalar="float")


def write_solver(folder, petsc=REAL, dolfinx="0.11.0"):
    """Write packages that stand in for dolfinx, mpi4py and petsc4py."""
    modules = {
        "dolfinx": f"__version__ = {dolfinx!r}",
        "mpi4py/MPI": "COMM_SELF = None",
        "petsc4py/PETSc": petsc,
    }
    for name, code in modules.items():
        module = folder / f"{name}.py"
        module.parent.mkdir(parents=True, exist_ok=True)
        module.write_text(code + "\n")


def write_metadata(folder):
    """Write the metadata of the packages that pyproject.toml lists."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for requirement in project["dependencies"]:
        name = re.split(r"[<>=]", requirement)[0]
        metadata = folder / f"{name.replace('-', '_')}-1.dist-info" / "METADATA"
        metadata.parent.mkdir()
        metadata.write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n")


@pytest.fixture
def active(outside, tmp_path):
    """Return variables of an active venv with stand-ins for the solver."""
    folder = tmp_path / "active"
    venv = [sys.executable, "-m", "venv", "--without-pip", folder]
    subprocess.run(venv, check=True, timeout=60)
    # ./run would make its own environment by the former
    for python in [*(folder / "bin").glob("python3*"), folder / "bin" / "python"]:
        python.unlink()
    (folder / "bin" / "python").symlink_to(sys._base_executable)
    write_program(folder / "bin", "tool", "#!/bin/sh\necho from the active one\n")
    write_solver(packages_of(folder))
    write_metadata(packages_of(folder))
    path = f"{folder / 'bin'}:{outside['PATH']}"
    return outside | {"VIRTUAL_ENV": str(folder), "PATH": path}


def packages_of(folder):
    (found,) = folder.glob("lib/python*/site-packages")
    return found


def test_an_active_environment_with_the_solver_is_taken_whatever_variables_name_another(
    active, tmp_path
):
    write_solver(tmp_path / "foreign", OPEN_MPI)
    other = {
        "PETSC_DIR": "/nowhere",
        "PETSC_ARCH": "linux-gnu",
        "PYTHONPATH": str(tmp_path / "foreign"),
        "CONDA_PREFIX": "/behind/it/on/PATH",
    }
    assert run("tool", env=active | other).stdout == "from the active one\n"


def lose_nibabel(packages):
    (nibabel,) = packages.glob("nibabel-*")
    shutil.rmtree(nibabel)


@pytest.mark.parametrize(
    "change",
    [
        lambda packages: write_solver(packages, PETSC.format(scalar="complex")),
        lambda packages: write_solver(packages, OPEN_MPI),
        lambda packages: write_solver(packages, dolfinx="0.10.0"),
        lose_nibabel,
    ],
    ids=["complex numbers", "another MPI", "an old solver", "a package missing"],
)
def test_an_active_environment_that_cannot_run_gyriflow_is_not_taken(
    active, tmp_path, change
):
    change(packages_of(tmp_path / "active"))
    (tmp_path / "active" / "bin" / "tool").unlink()
    assert run("tool", "1", env=active).stdout == MADE(1)


def test_with_conda_and_a_venv_active_the_first_python_on_path_decides(
    active, tmp_path
):
    write_program(tmp_path / "conda" / "bin", "python", FAIL)
    path = f"{tmp_path / 'conda' / 'bin'}:{active['PATH']}"
    conda_first = {"CONDA_PREFIX": str(tmp_path / "conda"), "PATH": path}
    assert run("tool", "1", env=active | conda_first).stdout == MADE(1)


def test_ranks_under_mpiexec_are_of_one_run():
    # without ends of lines: two ranks that write at once may mix them
    program = "from mpi4py import MPI; print(MPI.COMM_WORLD.size, end='')"
    done = ran("mpiexec", "-n", "2", RUN, "python", "-c", program, timeout_s=120)
    assert done.stdout == "22", done.stderr


# --- the set-up --------------------------------------------------------------------


def test_the_first_python_that_runs_makes_a_venv_from_the_lock_once(outside, tmp_path):
    first = run("tool", "1", env=outside)
    second = run("bash", "-c", "tool 2; exit 5", env=outside)
    assert (first.stdout, first.returncode) == (MADE(1), 0)
    assert (second.stdout, second.returncode) == (MADE(2), 5)
    (venv,) = (tmp_path / "cache").glob("venv-*/venv")
    assert first.stderr == Facts(venv.parent)
    assert second.stderr == ""
    calls = (tmp_path / "record").read_text().splitlines()
    assert f"-I -m venv {venv}" in calls
    (installation,) = [line for line in calls if "pip install" in line]
    locks = [f"-r {ROOT}/envs/requirements{part}.txt" for part in ("", "-dev")]
    assert "--require-hashes" in installation
    assert installation.endswith(" ".join(locks))


def test_a_python_of_pyenv_is_found_behind_shims(outside, programs, tmp_path):
    programs(**{"python3.13": SHIM})
    write_program(tmp_path / "pyenv" / "versions" / "3.14.2" / "bin", "python3", PYTHON)
    assert run("tool", "1", env=outside).stdout == MADE(1)


def test_a_python_with_wheels_goes_before_3_14(outside, programs):
    newer = PYTHON.replace("from the environment", "from 3.14")
    programs(**dict.fromkeys(("python3", "python3.14"), newer))
    assert run("tool", "1", env=outside).stdout == MADE(1)


def test_a_venv_whose_python_is_gone_is_made_again(outside, tmp_path):
    assert run("tool", "1", env=outside).returncode == 0
    (python,) = (tmp_path / "cache").glob("venv-*/venv/bin/python")
    python.unlink()
    python.symlink_to(tmp_path / "python of a pyenv version that was removed")
    assert run("tool", "2", env=outside).stdout == MADE(2)
    assert os.access(python, os.X_OK)


def test_the_set_up_uses_neither_the_users_python_home_nor_the_working_directory(
    outside, programs, tmp_path
):
    programs(id=USER)
    env = outside | {"PYTHONHOME": str(tmp_path)}
    assert run("tool", "1", env=env).stdout == MADE(1)
    for arguments in (tmp_path / "record").read_text().splitlines():
        assert arguments.startswith(("-I ", "-P "))


NO_PYTHON = {"python3.13": SHIM, "python3": FAIL, "python3.11": FAIL, "id": USER}


@pytest.mark.parametrize(
    ("texts", "record", "facts"),
    [
        ({"uname": ARM}, "record", ["3.12", "2.35", "envs/gyriflow.yaml"]),
        (NO_PYTHON, "record", ["3.12", "envs/gyriflow.yaml"]),
        ({"id": USER}, "record.no-ensurepip", ["apt-get install python3.13-venv"]),
    ],
    ids=["no wheels", "an old Python", "Debian's venv missing"],
)
def test_without_any_way_it_says_what_is_needed(
    bare, programs, tmp_path, texts, record, facts
):
    (tmp_path / record).touch()
    programs(**texts)
    done = run("tool", env=bare)
    assert done.returncode == 2
    assert done.stderr == Facts(*facts)
    assert not (tmp_path / "cache").exists()


def test_debians_package_for_venv_is_installed_as_root(root_on_debian, tmp_path):
    (tmp_path / "record.no-ensurepip").touch()
    assert run("tool", "1", env=root_on_debian).stdout == MADE(1)
    installation = "apt-get install -y --no-install-recommends python3.13-venv"
    assert installation in (tmp_path / "record").read_text().splitlines()


def test_ctrl_c_lets_an_installation_of_debian_packages_end(root_on_debian, tmp_path):
    record = tmp_path / "record"
    (tmp_path / "record.missing").write_text("libgl1\n")
    env = root_on_debian | {"SECONDS_TO_INSTALL": "1"}
    process = start("tool", env=env, process_group=0)
    assert wait_until(lambda: record.exists() and "libgl1" in record.read_text())
    # as a terminal does: to every process of the group
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(20) == 130
    assert record.read_text().splitlines()[-1] == "installed"


def test_the_tree_comes_from_the_mirror_of_debian_itself(
    root_on_debian, programs, tmp_path
):
    programs(**{"python3.13": SHIM}, unshare=NOTE_AND_FAIL, mmdebstrap="#!/bin/sh\n")
    done = run("tool", env=root_on_debian)
    assert done.stderr == Facts("create_tree")
    assert (tmp_path / "record").read_text().splitlines()[-1].endswith(" mirror")


@pytest.mark.parametrize(
    ("setup", "facts"),
    [
        ("mount -t tmpfs -o size=1m tmpfs {0} && {1}", ["1 MB", "3000"]),
        # left unfinished, then read-only for root too
        (
            "mount -t tmpfs tmpfs {0} && ! {1} && mount -o remount,ro {0} && {1}",
            ["cannot be written"],
        ),
    ],
)
def test_a_cache_on_a_full_or_foreign_disk_is_named_before_anything_is_loaded(
    outside, tmp_path, setup, facts
):
    cache = tmp_path / "cache"
    cache.mkdir()
    (tmp_path / "record.fails").touch()
    command = setup.format(cache, f"{RUN} tool")
    unshared = "unshare", "--map-root-user", "--mount", "sh", "-c", command
    done = ran(*unshared, env=outside)
    if "unshare" in done.stderr:
        pytest.skip("this machine allows no mounts")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == Facts(cache, "GYRIFLOW_CACHE", *facts)


@pytest.mark.parametrize(
    ("name", "create", "hook"),
    [
        ("conda", "env create", "shell.bash hook"),
        ("micromamba", "create --yes", "shell hook --shell bash"),
    ],
)
def test_conda_environment_is_made_once_and_activated(
    outside, programs, tmp_path, name, create, hook
):
    # a machine that is too old for the wheels
    programs(getconf=OLD_GLIBC, **{name: CONDA})
    recipe = ROOT / "envs" / "gyriflow.yaml"
    tag = hashlib.sha256(recipe.read_bytes()).hexdigest()[:12]
    prefix = tmp_path / "cache" / f"conda-{tag}" / "conda"
    first = run("tool", "1", env=outside)
    second = run("bash", "-c", "tool 2; exit 5", env=outside)
    assert (first.stdout, first.returncode) == (MADE(1), 0)
    assert (second.stdout, second.returncode) == (MADE(2), 5)
    assert first.stderr == Facts(prefix.parent)
    assert second.stderr == ""
    made = f"{create} -p {prefix} -f {recipe}"
    assert (tmp_path / "record").read_text().splitlines() == [made, hook, hook]


def test_bytecode_is_kept_which_every_process_would_make_again(outside):
    name = "PYTHONDONTWRITEBYTECODE"
    done = run("printenv", name, env=outside | {name: "1"})
    assert (done.stdout, done.returncode) == ("", 1)


def test_an_empty_home_is_that_of_the_user_not_the_root_of_the_system(
    outside, programs, tmp_path
):
    programs(getent=f"#!/bin/sh\necho me:x:0:0::{tmp_path}/home:/bin/sh\n")
    folders = {"GYRIFLOW_CACHE": "", "XDG_CACHE_HOME": "", "HOME": ""}
    assert run("tool", "1", env=outside | folders).stdout == MADE(1)
    assert list((tmp_path / "home" / ".cache" / "gyriflow").glob("venv-*/ready"))


def in_folder(folder, command, env):
    """Run ./run in a folder, after or before a command."""
    return ran("bash", "-c", f"cd '{folder}' && {command}'{RUN}' true", env=env)


def test_no_module_of_the_working_directory_is_imported(outside, tmp_path):
    (tmp_path / "dolfinx.py").write_text("open('foreign.ran', 'w')")
    env = outside | {"VIRTUAL_ENV": "x"}
    assert in_folder(tmp_path, "", env).returncode == 0
    assert not (tmp_path / "foreign.ran").exists()


def test_a_current_folder_that_was_deleted_is_named(outside, tmp_path):
    (tmp_path / "gone").mkdir()
    done = in_folder(tmp_path / "gone", "rmdir ../gone && ", outside)
    assert done.returncode == 2
    last = done.stderr.splitlines()[-1]
    assert last == Facts("gyriflow:", "the current folder no longer exists")


def test_no_process_stays_between_run_and_the_command(outside):
    process = start("bash", "-c", "echo $$ $PPID; exec sleep 60", env=outside)
    own, parent = map(int, process.stdout.readline().split())
    # the command has taken the place of the script, so signals to it are its own
    assert (own, parent) == (process.pid, os.getpid())
    process.terminate()
    assert process.wait(20) == -signal.SIGTERM


def test_failing_set_up_shows_why_and_is_tried_again(outside, tmp_path):
    fails = tmp_path / "record.fails"
    fails.touch()
    done = run("tool", env=outside)
    assert done.returncode == 2
    assert done.stderr == Facts("create_venv", "ConnectionError: no such thing")
    assert done.stdout == ""
    fails.unlink()
    assert run("tool", "now", env=outside).stdout == MADE("now")


def test_two_at_once_make_one_environment(outside, tmp_path):
    held, record = tmp_path / "record.wait", tmp_path / "record"
    held.touch()
    first = start("tool", "first", env=outside)
    assert wait_until(lambda: record.exists() and "pip install" in record.read_text())
    second = start("tool", "second", env=outside)
    waiting = second.stderr.readline()
    held.unlink()
    printed = [process.communicate(timeout=30)[0] for process in (first, second)]
    assert printed == [MADE("first"), MADE("second")]
    assert waiting == Facts("gyriflow:", "./run")
    assert record.read_text().count("pip install") == 1


def test_an_environment_is_made_without_locks(outside, programs, tmp_path):
    programs(flock="#!/bin/sh\nexit 71\n")
    done = run("tool", "1", env=outside)
    assert done.stdout == MADE(1)
    assert done.stderr == Facts(f"{tmp_path / 'cache'} has no locks")


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)],
)
def test_interrupted_set_up_leaves_nothing_running_and_is_redone(
    outside, tmp_path, number, code
):
    process = start("tool", "first", env=outside | {"SECONDS_TO_CREATE": OWN})
    assert wait_until(lambda: running(OWN))
    process.send_signal(number)
    assert process.wait(20) == code
    if number != signal.SIGKILL:
        assert process.stderr.read() == Facts("gyriflow:")
        assert wait_until(lambda: not running(OWN))
    # after SIGKILL the stand-in is gone, yet not what it had started: the next run
    # waits for that
    for orphan in running(OWN):
        os.kill(orphan, signal.SIGTERM)
    assert run("tool", "again", env=outside).stdout == MADE("again")
