#!/usr/bin/env bash
# envs/try_image.sh [FOLDER]: builds the image of envs/Dockerfile with buildah from Debian's packages alone, without a
# registry, and tries it: the command, the imports, and a shape that is meshed and folded on two ranks.
# Needs root, buildah, mmdebstrap and about 8 GB in FOLDER (default: a temporary one). All of it is removed at the end.
set -euo pipefail

here=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
work=$(mktemp -d "${1:-${TMPDIR:-/tmp}}/gyriflow-image-XXXXXX")
driver=overlay
[ "$(stat -f -c %T "$work")" != overlayfs ] || driver=vfs # no overlay on an overlay

build() { buildah --root "$work/storage" --runroot "$work/run" --storage-driver "$driver" "$@"; }
finish() {
    build rm --all >/dev/null 2>&1 || true
    umount "$work/storage/overlay" 2>/dev/null || true
    rm -rf --one-file-system "$work"
}
trap finish EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# what Docker Hub has under this name: Debian's essential packages and apt
echo "debian:13 from Debian's packages"
mirror=$(apt-get indextargets --format '$(REPO_URI) $(LABEL)' 'Created-By: Packages' | awk '$2 == "Debian" {print $1; exit}')
mmdebstrap --quiet --variant=minbase --include=ca-certificates trixie "$work/base.tar" \
    "deb ${mirror:-http://deb.debian.org/debian} trixie main"
base=$(build from scratch)
build add --quiet "$base" "$work/base.tar" / >/dev/null
build commit --quiet --rm "$base" localhost/debian:13 >/dev/null
rm "$work/base.tar"

# the network of this machine, also where it has its own index of packages and its own certificates
volumes=()
for file in /etc/pip.conf /etc/ssl/certs/ca-certificates.crt; do
    [ ! -e "$file" ] || volumes+=(--volume "$(readlink -f "$file"):$file:ro")
done
echo "the image of envs/Dockerfile"
build bud --isolation chroot --pull-never --quiet "${volumes[@]}" --tag gyriflow --file "$here/envs/Dockerfile" "$here" \
    >"$work/log" 2>&1 || { tail -n 30 "$work/log"; exit 1; }
build images --format '{{.Name}}:{{.Tag}} {{.Size}}'

mkdir "$work/study"
cat >"$work/study/shape.yaml" <<'STUDY'
brains: [{id: ball, week: 21, shape: {kind: sphere, radius_mm: 20}}]
start: ball
surface: {edge_length_mm: 3.0}
mesh: {order: 1, surface_edge_mm: 3.0, core_edge_mm: 6.0, mesher: tetgen, max_surface_distance_mm: 0.5}
folding: {end_week: 21.5, thickness_mm: 4.0, support: free, no_growth: {kind: none}, contact: {kind: none}, ranks: 2}
metrics: {curvature_radius_mm: 9.0}
runs: {reference: {}}
STUDY
container=$(build from --pull-never gyriflow)
# as with `docker run -v "$PWD:$PWD" -w "$PWD"`
inside() {
    echo "+ $*"
    build run --isolation chroot --volume "$here:$here" --volume "$work/study:/study" --workingdir "$here" "$container" -- "$@"
}
inside gyriflow --version
inside python -c 'import dolfinx, pymeshlab, pytetwild, pyvista; print("dolfinx", dolfinx.__version__)'
inside gyriflow run /study/shape.yaml --cores 2 --stage folding --directory /study
test -s "$work/study/results/runs/reference/ball/folding/summary.json"
echo "the image works"
