#!/bin/sh
# install_image.sh VERSION: installs gyriflow of /opt/gyriflow and what it needs into an image of Debian with Python, from
# the lists beside this script. Run by the Dockerfile and gyriflow.def.
set -eu
envs=$(dirname "$0")
export SETUPTOOLS_SCM_PRETEND_VERSION="$1" DEBIAN_FRONTEND=noninteractive

apt-get update
sed 's/#.*//' "$envs/debian.txt" | xargs apt-get install -y --no-install-recommends
rm -rf /var/lib/apt/lists/* /var/cache/apt/archives/*.deb

python -m venv /opt/venv
/opt/venv/bin/pip install --no-cache-dir --no-compile --no-deps --require-hashes -r "$envs/requirements.txt"
/opt/venv/bin/pip install --no-cache-dir --no-compile --no-deps "$envs/.."

# wheels bring their own tests, libraries to link with, programs for other systems, symbols for debugging, and copies
cd /opt/venv/lib/python3.13/site-packages
find . \( -name tests -o -name '*.a' -o -path '*/cbc/osx' -o -path '*/cbc/win' \) -prune -exec rm -r {} +
strip --strip-unneeded vtkmodules/*.so petsc4py/lib/*.so
hardlink --quiet /opt/venv
