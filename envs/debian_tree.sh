# The Debian tree of ./run, which reads this file: making it, entering it, running a command in it.
# Uses `env` (folder of the environment), `here`, `cache`, `suite`, `bind`, `certificates` of ./run and its functions say,
# fail, part, listed and apt_install; fills `enter`.
# shellcheck shell=bash disable=SC2154

# whose a suite is: fills `vendor`, `keys`, `keyring` (the package of the keys), `mirror` and `components`
know_suite() {
    vendor=Debian keys=/usr/share/keyrings/debian-archive-keyring.gpg keyring=debian-archive-keyring
    mirror=http://deb.debian.org/debian components=main
    case $suite in
        trixie | forky | sid | testing | unstable) ;;
        *)
            vendor=Ubuntu keys=/usr/share/keyrings/ubuntu-archive-keyring.gpg keyring=ubuntu-keyring
            mirror=http://archive.ubuntu.com/ubuntu components="main universe"
            ;;
    esac
}

install_tools() {
    know_suite
    command -v mmdebstrap >/dev/null && command -v bwrap >/dev/null && [ -e "$keys" ] && return
    say "installing mmdebstrap and bubblewrap on this machine"
    # the keys are missing on a machine of the other vendor
    if [ -e "$keys" ]; then keyring=; fi
    apt_install mmdebstrap bubblewrap ${keyring:+"$keyring"}
}

create_tree() {
    local own_mirror include option options=()
    [ ! -e "$env/tree.ready" ] || return 0
    say "making a tree of $vendor $suite (about 1.5 minutes, 2 GB)"
    rm -rf --one-file-system "$env/tree"
    # the mirror and apt settings (proxies, dates) of this machine, where it is of that vendor
    # shellcheck disable=SC2016  # apt expands these
    own_mirror=$(apt-get indextargets --format '$(REPO_URI) $(ORIGIN) $(LABEL)' 'Created-By: Packages' |
        awk -v vendor="$vendor" '$2 == vendor && $3 == vendor {print $1; exit}')
    while IFS= read -r option; do options+=("--aptopt=$option"); done < <(apt-config dump |
        grep -E '^Acquire::(https?::(Proxy|Proxy-Auto-Detect|CaInfo|Verify-Peer|Verify-Host)|Check-Valid-Until|Check-Date)\b.* ".+";')
    # mirrors that keep a day of a suite that changes daily say rightly that it is an old one
    [ "$suite" = trixie ] || options+=(--aptopt='Acquire::Check-Valid-Until "false"')
    include=$(listed "$here/envs/debian.txt" | tr ' ' ,)
    # in namespaces of its own: killed, it leaves neither processes nor mounts behind
    part unshare --mount --pid --fork --kill-child --mount-proc \
        mmdebstrap --mode=root --variant=apt --include="$include" "${options[@]}" \
        --aptopt='APT::Install-Recommends "false"' --dpkgopt='path-exclude=/usr/share/man/*' \
        --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/locale/*' \
        "$suite" "$env/tree" \
        "deb [signed-by=$keys] ${own_mirror:-$mirror} $suite $components" || return
    # files of the machine that are bound over the tree's need a place to be bound to
    touch "$env/tree/etc/"{resolv.conf,hosts,pip.conf,passwd,group} "$env/tree/etc/ssl/certs/ca-certificates.crt"
    touch "$env/tree.ready"
}

# What the tree sees: its own /usr and /etc, and the machine's other folders. /dev/shm and /run are private, since
# Open MPI names its files by process ids, which repeat in the process namespaces of two ./run.
# Fills `folders` (bound as they are), `links` (in /) and `files` (the machine's file, then its place in the tree).
survey_machine() {
    local dir file
    folders=() links=() files=()
    for dir in /* /.[!.]*; do
        case $dir in
            /bin | /boot | /dev | /etc | /lib | /lib32 | /lib64 | /libx32 | /lost+found | /proc | /run | /sbin | /sys | /usr) ;;
            *) if [ -L "$dir" ]; then links+=("$dir"); elif [ -d "$dir" ]; then folders+=("$dir"); fi ;;
        esac
    done
    for dir in "$here" "$cache" "$PWD" "${TMPDIR:-/tmp}" "${bind[@]}"; do
        dir=$(realpath -m "$dir")
        case $dir in
            /usr/* | /etc/* | /run/*) if [ -d "$dir" ]; then folders+=("$dir"); fi ;;
        esac
        # its own folders are the tree's, so a place is made there, once
        case $dir in /usr/* | /etc/*) [ -d "$env/tree$dir" ] || mkdir -p "$env/tree$dir" || true ;; esac
    done
    for file in /etc/resolv.conf /etc/hosts /etc/pip.conf /etc/passwd /etc/group; do
        if [ -e "$file" ]; then files+=("$(readlink -f "$file")" "$file"); fi
    done
    # networks with their own certificate authority
    for file in "${SSL_CERT_FILE:-}" "$certificates"; do
        if [ -f "$file" ]; then files+=("$(readlink -f "$file")" "$certificates"); break; fi
    done
}

# Fills `enter` with the command that enters the tree; it ends in `env`, so that NAME=VALUE may come next.
# shellcheck disable=SC2054  # commas that env wants
enter_by_bwrap() {
    local item
    enter=(bwrap --tmpfs / --ro-bind "$env/tree/usr" /usr --ro-bind "$env/tree/etc" /etc
        --symlink usr/bin /bin --symlink usr/sbin /sbin --symlink usr/lib /lib --symlink usr/lib64 /lib64
        --dev-bind /dev /dev --perms 1777 --tmpfs /dev/shm --perms 1777 --tmpfs /run
        --unshare-pid --proc /proc --ro-bind-try /sys /sys --die-with-parent)
    for item in "${folders[@]}"; do enter+=(--bind "$item" "$item"); done
    for item in "${links[@]}"; do enter+=(--symlink "$(readlink "$item")" "$item"); done
    for ((item = 0; item < ${#files[@]}; item += 2)); do enter+=(--ro-bind "${files[@]:item:2}"); done
    enter+=(--chdir "$PWD" env --default-signal=INT,QUIT,TERM,HUP)
}

# Where bwrap may not make its namespaces, a chroot with bind mounts in a mount namespace of its own may do. Its
# first process is a shell, since signals that a process namespace's first one does not handle are lost.
# shellcheck disable=SC2016,SC2317  # expanded by the inner shell
enter_by_chroot() {
    local item
    for item in "${links[@]}"; do [ -e "$env/tree$item" ] || cp -P "$item" "$env/tree$item" || true; done
    enter=(setpriv --pdeathsig KILL unshare --mount --pid --fork --kill-child bash -c '
        set -e
        tree=$1 folders=$2 files=$3 cd=$4; shift 4
        mount --bind "$tree" "$tree"
        mount --rbind /dev "$tree/dev"
        mount --rbind /sys "$tree/sys"
        mount -t proc proc "$tree/proc"
        mount -t tmpfs -o mode=1777 tmpfs "$tree/dev/shm"
        mount -t tmpfs -o mode=1777 tmpfs "$tree/run"
        for dir in "${@:1:folders}"; do
            mkdir -p "$tree$dir"
            mount --rbind "$dir" "$tree$dir"
        done
        shift "$folders"
        for ((i = 1; i < files; i += 2)); do
            j=$((i + 1))
            mount --bind "${!i}" "$tree${!j}"
        done
        shift "$files"
        exec chroot "$tree" bash -c '\''cd "$0" && env --default-signal=INT,QUIT,TERM,HUP "$@"; exit'\'' "$cd" "$@"
        ' enter "$env/tree" "${#folders[@]}" "${#files[@]}" "$PWD" "${folders[@]}" "${files[@]}")
}

choose_entry() {
    local way problem=
    unset LD_LIBRARY_PATH LD_PRELOAD PYTHONHOME
    PATH=$PATH:/usr/sbin:/sbin
    survey_machine
    for way in enter_by_bwrap enter_by_chroot; do
        "$way"
        problem+=$({ "${enter[@]}" true; } 2>&1 </dev/null) && break
        enter=()
    done
    [ ${#enter[@]} -gt 0 ] || fail "neither bwrap nor chroot may enter $env/tree here (a container without these
rights?): $problem
Use conda instead: $by_hand"
    export LC_ALL=C.UTF-8 PRTE_MCA_prte_tmpdir_base=/run
    export SSL_CERT_FILE=$certificates PIP_CERT=$certificates REQUESTS_CA_BUNDLE=$certificates CURL_CA_BUNDLE=$certificates
}

# The command runs in a process namespace that dies with this script: nothing is left behind. Ctrl-C reaches it from
# the terminal; without one, it has a process group of its own and gets what is sent to this script. What is between
# this script and the command ignores signals.
# shellcheck disable=SC2064  # the traps' words are known when they are set
run_in_tree() {
    local child code signal session=() signalled=
    [ -t 0 ] || session=(setsid)
    (trap '' INT QUIT TERM HUP && exec "${session[@]}" "${enter[@]}" "$@") <&0 &
    child=$!
    if [ -t 0 ]; then
        trap '' INT QUIT
        for signal in TERM HUP; do trap "signalled=1; signal_command $signal $child 2>/dev/null" "$signal"; done
    else
        for signal in INT QUIT TERM HUP; do
            trap "signalled=1; kill -$signal -- -$child 2>/dev/null || true" "$signal"
        done
    fi
    while :; do
        signalled=
        wait "$child" && code=0 || code=$?
        # a trapped signal ends `wait` early, a second one gives the command's own code
        [ -n "$signalled" ] || exit "$code"
    done
}

# signal_command SIGNAL ENTRY: to the children of the process namespace's first process, ENTRY's only child
signal_command() {
    local first commands
    read -r first <"/proc/$2/task/$2/children" || true # has no line end
    read -ra commands <"/proc/$first/task/$first/children" || true
    kill -"$1" "${commands[@]}" || true
}
