#!/bin/bash
# Installs a release of bunraku on a box without a network, beside the ones before it, and switches in one step.
set -euo pipefail

usage() {
    cat <<'HELP'
Usage: install.sh [FOLDER]         install the release in FOLDER (left out: the folder of this script) and start it
       install.sh --list           the releases on this box; * is the one that dances
       install.sh --rollback       back to the release before
       install.sh --use VERSION    to a release that --list names
       install.sh --uninstall      take bunraku off this box; shows, keys and journal in /data stay
       install.sh --uninstall --purge      the same, and /data/bunraku with all shows, keys and the journal

  --root DIR             work on the root file system in DIR (an image) instead of this machine's
  --until-power-off      try the release although this root forgets everything when the power goes
  --help                 this text

For Debian 13 and Raspberry Pi OS (amd64, arm64), as root:
  sudo bash /media/bunraku/bunraku/release/install.sh

Nothing is switched before the new release is whole on the disk and has danced for a moment where nobody sees it.
If it does not start, the box goes back to the release before. Pull the plug whenever you want: the box then has
the old release or the new one. Two releases before the current one stay.
Exit status: 0 done; 1 refused or gone back (the message says why), the box dances as before.
HELP
}

say() { echo "install: $*"; }
fail() { echo "install: $*" >&2; exit 1; }

KEPT=2
home=/opt/bunraku
data=/data/bunraku
root='' action=install source='' chosen='' purge=no fleeting=no

read_options() {
    while [ $# -gt 0 ]; do
        case $1 in
        --root) root=$(cd "${2:?--root needs a folder}" && pwd) && shift ;;
        --list | --rollback | --uninstall) action=${1#--} ;;
        --use) action=use chosen=${2:?--use needs a version; see --list} && shift ;;
        --purge) purge=yes ;;
        --until-power-off) fleeting=yes ;;
        -h | --help) usage && exit 0 ;;
        -*) fail "unknown option '$1'. See install.sh --help." ;;
        *) source=$1 ;;
        esac
        shift
    done
    [ "$root" != / ] || root=''
    [ -n "$source" ] || source=$(dirname "$0")
    releases=$root$home/releases
}

in_root() { if [ -n "$root" ]; then chroot "$root" "$@"; else "$@"; fi; }
runs_here() { [ -z "$root" ] && [ -d /run/systemd/system ]; }
current() { basename "$(readlink "$root$home/current" 2>/dev/null)" 2>/dev/null; }
fact() { sed -n "s/^$2 //p" "$1/release"; }

# What --list shows: "number version", oldest first. The number says in which order they came, whatever the clock said.
installed() {
    local folder
    for folder in "$releases"/*/; do
        if [[ -f $folder/number && $folder != *.part/ ]]; then echo "$(<"$folder/number") $(basename "$folder")"; fi
    done | sort -n
}

# ---- before anything is written

check_source() {
    [ -f "$source/release" ] && [ -f "$source/SHA256SUMS" ] ||
        fail "no release in $source. Name the folder that 'make release' wrote, on a stick: bunraku/release."
    version=$(fact "$source" version)
    [[ $version =~ ^[0-9A-Za-z.+-]+$ ]] || fail "the release in $source has no version. Copy it to the stick anew."
}

check_machine() {
    local python arch have needs
    [ "$(id -u)" = 0 ] || fail "this needs root. Try again with sudo."
    arch=$(in_root dpkg --print-architecture) || fail "this is not Debian or Raspberry Pi OS."
    [ "$arch" = "$(fact "$source" architecture)" ] ||
        fail "this box is $arch, the release is for $(fact "$source" architecture). Take the release for $arch."
    python=$(fact "$source" python)
    in_root "/usr/bin/python$python" -c 'import venv' 2>/dev/null ||
        fail "Python $python is missing. Bunraku is made for Debian 13; there: apt-get install libpython3-stdlib"
    mkdir -p "$releases"
    needs=$(fact "$source" needs-mb)
    have=$(df --output=avail -m "$releases" | tail -n 1 | tr -d ' ')
    [ "$have" -ge "$needs" ] || fail "$have MB are free on $releases, $needs MB are needed." \
        "Nothing was changed. Take an old release away (--list) or use a larger card."
    check_memory_of_root
}

# An image's root lies under an overlay in memory: what is written there is gone with the power.
check_memory_of_root() {
    [ "$fleeting" = yes ] || [ "$(stat -f -c %T "$releases")" != overlayfs ] ||
        fail "this box runs from a read-only image: an installation would be forgotten at power-off." \
            "Write the new image to its card (shows and keys in /data stay), or try the release with --until-power-off."
}

# ---- a release of its own beside the others

copy_and_verify() {
    local file
    mkdir -p "$part/source"
    while read -r _ file; do
        mkdir -p "$part/source/$(dirname "$file")"
        cp "$source/$file" "$part/source/$file" ||
            fail "$file could not be read from $source. Is the stick still in? The box dances as before."
    done <"$source/SHA256SUMS"
    cp "$source/SHA256SUMS" "$part/source/"
    (cd "$part/source" && sha256sum --check --strict --quiet SHA256SUMS >&2) ||
        fail "files on the stick are damaged (named above). Copy the release to it anew. The box dances as before."
}

build() {
    local inside=${part#"$root"} python=$part/bin/python
    in_root "/usr/bin/python$(fact "$part/source" python)" -m venv --without-pip "$inside"
    in_root "$inside/bin/python" -I "$inside/source/pip.whl/pip" --isolated --quiet --disable-pip-version-check --no-cache-dir \
        install --no-index --find-links "$inside/source/wheels" --no-deps --require-hashes --no-compile \
        --no-warn-script-location --root-user-action ignore -r "$inside/source/requirements.txt" ||
        fail "the packages could not be unpacked (above). The box dances as before."
    site=$(echo "$part"/lib/python3*/site-packages)
    drop_unneeded
    write_command
    in_root "$inside/bin/python" -I -m compileall -q -j 0 -s "$inside" -p "$home/releases/$name" "$inside/lib"
    cp -r "$part/source/system" "$part/source/release" "$part/source/SHA256SUMS" "$part/source/install.sh" "$part/"
    rm -r "$part/source"
}

drop_unneeded() {
    local pattern
    shopt -s globstar nullglob
    while read -r pattern; do
        # shellcheck disable=SC2086 # a pattern, not a path
        case $pattern in '' | '#'*) ;; *) (cd "$site" && rm -rf -- $pattern) ;; esac
    done <"$part/source/unneeded.txt"
    shopt -u globstar nullglob
}

# Built as VERSION.part and renamed when whole: scripts that name their folder get the final one.
write_command() {
    find "$part/bin" -type f -delete
    printf '#!%s/bin/python -I\nimport sys\n\nfrom appliance.cli import main\n\nsys.exit(main())\n' \
        "$home/releases/$name" >"$part/bin/bunraku"
    chmod 755 "$part/bin/bunraku"
}

preflight() {
    local folder=$home/releases/$1
    if [ -n "$root" ]; then
        in_root "$folder/bin/python" -I -c 'import appliance.cli'
    else
        "$folder/bin/python" -I -m appliance.cli preflight --check-release
    fi
}

install_release() {
    local number
    check_source
    check_machine
    name=$version
    if [ -d "$releases/$name" ] && ! cmp -s "$releases/$name/SHA256SUMS" "$source/SHA256SUMS"; then
        name=$version-$(sha256sum <"$source/SHA256SUMS" | cut -c 1-8)
    fi
    if [ ! -d "$releases/$name" ]; then
        part=$releases/$name.part
        rm -rf "$releases"/*.part
        say "bunraku $version: reading and checking $source"
        copy_and_verify
        say "unpacking"
        build
        number=$(installed | tail -n 1 | cut -d ' ' -f 1)
        echo $((${number:-0} + 1)) >"$part/number"
        say "trying it"
        preflight "$name.part" || { rm -rf "$part"; fail "this release does not work on this box (above)." \
            "The box dances as before."; }
        sync -f "$part"
        mv "$part" "$releases/$name"
        sync -f "$releases"
    fi
    switch_or_go_back "$name"
    forget_old
}

# ---- the switch

# Everything that systemd and udev read points into `current`: renaming one link switches all of it at once.
system_files() { (cd "$1/system" 2>/dev/null && find etc usr -type f 2>/dev/null) || true; }

link() {
    mkdir -p "$(dirname "$2")"
    ln -sfn "$1" "$2.new" && mv -T "$2.new" "$2"
}

link_system_files() {
    local file
    while read -r file; do link "$home/current/system/$file" "$root/$file"; done < <(system_files "$1")
    link "$home/current/bin/bunraku" "$root/usr/local/bin/bunraku"
}

switch_to() {
    link_system_files "$releases/$1"
    sync -f "$root/etc"
    link "releases/$1" "$root$home/current"
    sync -f "$root$home"
}

switch_or_go_back() {
    local before
    before=$(current)
    switch_to "$1"
    if restart; then
        say "bunraku $1 is installed"
    else
        fail "bunraku $1 did not start."
    fi
}

restart() { if runs_here; then systemctl daemon-reload && systemctl restart bunraku.target; fi; }

forget_old() {
    local folder
    for folder in $(installed | cut -d ' ' -f 2 | grep -vxF "$(current)" | head -n -"$KEPT"); do
        rm -rf "${releases:?}/$folder"
    done
}

list() {
    local number name
    installed | while read -r number name; do
        if [ "$name" = "$(current)" ]; then echo "* $name"; else echo "  $name"; fi
    done
}

read_options "$@"
case $action in
install) install_release ;;
list) list ;;
*) fail "--$action comes soon" ;;
esac
