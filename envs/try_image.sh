#!/usr/bin/env bash
# envs/try_image.sh [FOLDER]: builds the image of envs/Dockerfile with buildah from Debian's packages alone, without a
# registry, and tries it: the command, the imports, and a scan of a BIDS folder that is folded on two ranks.
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

# what Docker Hub has under this name is nearly this: Debian's essential packages, apt, and Python (there, not Debian's)
echo "python:3.13-slim from Debian's packages"
mirror=$(apt-get indextargets --format '$(REPO_URI) $(LABEL)' 'Created-By: Packages' | awk '$2 == "Debian" {print $1; exit}')
mmdebstrap --quiet --variant=minbase --include=ca-certificates,python3-dev,python3-venv,python-is-python3 trixie "$work/base.tar" \
    "deb ${mirror:-http://deb.debian.org/debian} trixie main"
base=$(build from scratch)
build add --quiet "$base" "$work/base.tar" / >/dev/null
build commit --quiet --rm "$base" docker.io/library/python:3.13-slim >/dev/null
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

# a scan of the shipped atlas, of very coarse triangles
scan=$work/study/data/derivatives/seg/sub-01/anat
mkdir -p "$scan"
cp "$here/atlases/spina-bifida/fetal_SB_atlas_GA21_notoperated/parcellation.nii.gz" "$scan/sub-01_dseg.nii.gz"
printf 'participant_id\tgestational_age\nsub-01\t21\n' >"$work/study/data/participants.tsv"
cat >"$work/study/settings.yaml" <<'STUDY'
surface: {edge_length_mm: 3.0}
mesh: {order: 1, surface_edge_mm: 3.0, core_edge_mm: 6.0, mesher: tetgen, max_surface_distance_mm: 1.5}
start: all
folding: {end_week: 22, thickness_mm: 4.0, step_s: 302400, ranks: 2}
metrics: {curvature_radius_mm: 7.0, spangy_modes: 60}
runs: {reference: {}}
STUDY
container=$(build from --pull-never gyriflow)
chown -R 1000:1000 "$work/study"
inside() {
    echo "+ $*"
    build run --isolation chroot --user 1000:1000 --volume "$work/study:/study" "$container" -- "$@"
}
inside gyriflow --version
inside python -c 'import gyriflow.folding, dolfinx, pymeshlab, pytetwild, pyvista; print("dolfinx", dolfinx.__version__)'
inside gyriflow /study/data /study/out participant --fold --settings /study/settings.yaml --cores 2
test -s "$work/study/out/sub-01/anat/sub-01_hemi-L_desc-referencegw2200_pial.surf.gii"
echo "the image works"
