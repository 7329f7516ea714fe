#!/usr/bin/env bash
# envs/try_run.sh [FOLDER]: sets up `./run` and makes the demo as an ordinary user of a Debian 13 machine that has only
# Python, a compiler and libraries (envs/debian.txt), and compares the demo's numbers.
# Needs root, mmdebstrap and about 4 GB in FOLDER (default: a temporary one). All of it is removed at the end.
set -euo pipefail

here=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
work=$(mktemp -d "${1:-${TMPDIR:-/tmp}}/gyriflow-run-XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

packages=python3-dev,python3-venv,procps,$(sed 's/#.*//' "$here/envs/debian.txt" | xargs | tr ' ' ,)
mirror=$(apt-get indextargets --format '$(REPO_URI) $(LABEL)' 'Created-By: Packages' | awk '$2 == "Debian" {print $1; exit}')
mmdebstrap --quiet --variant=minbase --include="$packages" trixie "$work/tree" \
    "deb ${mirror:-http://deb.debian.org/debian} trixie main"
home=$work/tree/home/user
mkdir -p "$home/gyriflow"
git -C "$here" archive HEAD | tar -x -C "$home/gyriflow"
chown -R 1000:1000 "$home"
echo "user:x:1000:1000::/home/user:/bin/bash" >>"$work/tree/etc/passwd"
# the network of this machine, also where it has its own certificates
for file in /etc/resolv.conf /etc/pip.conf /etc/ssl/certs/ca-certificates.crt; do
    [ ! -e "$file" ] || cp -L "$file" "$work/tree$file"
done

# mounts and processes of this part end with it
# shellcheck disable=SC2016  # expanded by the inner shell
unshare --mount --pid --fork --kill-child sh -c '
    mount -t proc proc "$0/proc"
    mount --rbind /dev "$0/dev"
    exec chroot --userspec=1000:1000 "$0" env -i HOME=/home/user PATH=/usr/bin:/bin bash -c "$1"
' "$work/tree" '
    cd /home/user/gyriflow && set -e
    echo "environment:" && time ./run true
    echo "demo:" && time ./run gyriflow run config/config.yaml --cores 2
    ./run python tests/demo_numbers.py
'
echo "./run works"
