#!/bin/bash
# Installs a release of bunraku on a box without a network, beside the ones before it, and switches in one step.
set -euo pipefail

usage() {
    cat <<'HELP'
Usage: install.sh [FOLDER]         install the release in FOLDER (left out: where this script lies, else the
                                   stick's bunraku/release) and start it
       install.sh --list           the releases on this box; * is the one that dances
       install.sh --rollback       back to the release before
       install.sh --use VERSION    to a release that --list names
       install.sh --data PARTITION     keep what must outlive power-off on this partition (/dev/sda1), as /data
       install.sh --uninstall      take bunraku off this box; shows, keys and the journal in /data/bunraku stay
       install.sh --uninstall --purge      these too

  --root DIR             work on the root file system in DIR (an image) instead of this machine's
  --until-power-off      keep the release in memory: on a box made from the image, for a trial
  --older                take a release that is older than the one that dances
  --key FINGERPRINT      take a release signed with this key (SHA256:...) and no other, whatever this box knows
  --unsigned             do not ask who made the release. It gives up all protection against a foreign stick:
                         whoever wrote it has this box. For releases that you have made yourself.
  --help                 this text

For Debian 13 and Raspberry Pi OS (amd64, arm64), as root, with the stick that `make release` is copied to. The
first time, on a machine that has no bunraku, with the script on the stick, which such a machine does not mount itself:
  sudo mkdir -p /media/bunraku && sudo mount -o ro /dev/disk/by-label/BUNRAKU /media/bunraku
  sudo bash /media/bunraku/bunraku/release/install.sh
On a box that has a release already, with the box's own, for the one on a foreign stick could do anything:
  sudo bunraku-install

A release is taken when it is signed with a key that the release on this box names. A machine without a release knows
no key: it takes any signed release, says with which key, and keeps to the keys which that one names.

What must outlive power-off (sensors' keys, shows, the journal) is kept in /data. Where that is in memory, nothing is
installed: --data gives it a partition. It is needed before a read-only root is switched on.

Nothing is switched before the new release lies whole on the disk and has danced for a moment out of
sight. If it does not start then, the box goes back to the release before. Whenever the power fails, the box
has the old release or the new one, whole. Two releases before the current one stay.

A box made from the image forgets what is written to its root. Its releases lie on the data partition, in
/data/bunraku-releases, and at each power-on the chosen one is switched to before anything dances. The release
that came with the image always stays, and dances when the chosen one is damaged or does not dance.
Exit status: 0 done; 1 refused, or gone back to the release before: the message says why.
HELP
}

say() { echo "install: $*"; }
fail() { echo "install: $*" >&2; exit 1; }

KEPT=2
# How long a release has until it dances, and how many starts of its stage: more than it takes to put aside two shows
# that do not dance.
STARTS_WITHIN_S=20
STARTS_TRIED=10
STAYS_S=3
# At power-on: how long a release on the data partition has until it dances, for how long it must dance, and after how
# many power-ons without that it is no longer tried.
DANCES_WITHIN_S=120
DANCES_FOR_S=5
POWER_ONS_TRIED=5
HEAD_BYTES=1048576 # of SHA256SUMS, its signature, and `release`; real ones have a hundredth of that
signed_as=bunraku-release # a signature that the same key made for something else counts for nothing
once=/run/bunraku-release # bunraku-release.service looks for it
home=/opt/bunraku
data=/data/bunraku
stick=/media/bunraku/bunraku/release
units=usr/lib/systemd/system
users=system/usr/lib/sysusers.d/bunraku.conf
root='' action=install source='' chosen='' purge=no fleeting=no part='' fresh=no
head='' key='' unsigned=no older=no partition=''

read_options() {
    while [ $# -gt 0 ]; do
        case $1 in
        --root)
            [ -d "${2:-}" ] || fail "--root: there is no folder '${2:-}'. Nothing was touched."
            root=$(cd "$2" && pwd)
            shift
            ;;
        --list | --rollback | --uninstall) action=${1#--} ;;
        --data)
            [ $# -gt 1 ] || fail "--data needs a partition, like /dev/sda1: lsblk -f shows which there are."
            action=data partition=$2
            shift
            ;;
        --use)
            [ $# -gt 1 ] || fail "--use needs a version: install.sh --list shows which there are."
            action=use chosen=$2
            shift
            ;;
        --at-power-on) action=at-power-on ;;                 # bunraku-release.service
        --watch) action=watch chosen=${2:?} && shift ;;      # what that starts
        --purge) purge=yes ;;
        --until-power-off) fleeting=yes ;;
        --key)
            [[ ${2:-} =~ ^SHA256:[0-9A-Za-z+/]{43}$ ]] ||
                fail "--key needs the key's fingerprint, SHA256: and 43 characters. Ask the release's maker for it."
            key=$2
            shift
            ;;
        --unsigned) unsigned=yes ;;
        --older) older=yes ;;
        -h | --help) usage && exit 0 ;;
        -*) fail "unknown option '$1'. See install.sh --help." ;;
        *) source=$1 ;;
        esac
        shift
    done
    [ "$root" != / ] || root=''
    [ -n "$source" ] || source=$(dirname "$0")
    [ -d "$source/wheels" ] || [ "$source" != "$(dirname "$0")" ] || source=$stick
    releases=$root$home/releases kept=$root/data/bunraku-releases store=$releases
    if ! forgets || [ $fleeting = yes ]; then return; fi
    store=$kept
}

# An overlay in memory covers an image's root.
forgets() { [ "$(stat -f -c %T "$root/opt")" = overlayfs ] && { [ -z "$root" ] || has_data; }; }
has_data() { mountpoint --quiet "$root/data"; }

# Data written to $1 is lost at power-off: prints the file system in memory that holds it, or nothing. An
# overlay keeps
# it where its upper folder lies; under one over the root that is memory, as far as can be seen.
memory_of() {
    local where=$1 kind upper
    while [ ! -e "$where" ]; do where=$(dirname "$where"); done
    kind=$(stat -f -c %T "$where")
    case $kind in
    tmpfs | ramfs) echo "$kind" ;;
    overlayfs)
        where=$(stat -c %m "$where")
        upper=$(sed -n "s|^[^ ]* $where overlay .*upperdir=\([^, ]*\).*|\1|p" "${BUNRAKU_MOUNTS:-/proc/mounts}" | tail -n 1)
        if [[ $where = / || ! -d $upper ]]; then echo overlay; else memory_of "$upper"; fi
        ;;
    esac
}

# A root that does not run has no /proc, and the packages ask it for the processor. This machine's environment
# (library paths) is meaningless in there.
in_root() {
    # shellcheck disable=SC2016 # $0 and $@ belong to the inner shell
    if [ -z "$root" ]; then "$@"; else
        unshare --mount bash -c 'mount --rbind /proc "$0/proc" 2>/dev/null
            [ -w "$0/dev/shm" ] || mount -t tmpfs -o mode=1777 tmpfs "$0/dev/shm" 2>/dev/null
            exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin chroot "$0" "$@"' "$root" "$@"
    fi
}

runs_here() { [ -z "$root" ] && [ -d /run/systemd/system ]; }
fact() { sed -n "s/^$2 //p" "$1/release"; }
current() { basename "$(readlink "$root$home/current" || true)"; }

# Oldest first, as "number version": the number says in which order they came, whatever the clock said.
installed() {
    local folder
    for folder in "$releases"/*/ "$kept"/*/; do
        if [[ -f $folder/number && $folder != *.part/ && $folder != */current/ ]]; then
            echo "$(<"$folder/number") $(basename "$folder")"
        fi
    done | sort -n | uniq
}

# The release that came with the image: the oldest one that is not on the data partition.
own() {
    local name
    while read -r _ name; do
        if [[ -d $releases/$name && ! -L $releases/$name ]]; then echo "$name" && return; fi
    done < <(installed)
}

# Releases on the data partition are seen among the others.
link_kept() {
    local folder name
    for folder in "$kept"/*/; do
        name=$(basename "$folder")
        if [[ -f $folder/whole && $name != *.part && $name != current && ! -e $releases/$name ]]; then
            ln -sfn "../../../data/bunraku-releases/$name" "$releases/$name"
        fi
    done
}

# One at a time; and whatever ends this script, no half release stays.
begin() {
    [ "$(id -u)" = 0 ] || fail "this needs root. Try again with sudo."
    mkdir -p "$releases"
    exec 9<"$releases"
    flock --nonblock 9 || fail "another installation is running on this box. Wait for its end."
    trap '[ -z "$part" ] || rm -rf "$part"; [ -z "$head" ] || rm -rf "$head"' EXIT
    umask 022
    link_kept
}

# ---- before anything is written

# Nothing of a release is believed before its signature has been checked. A stick may change between two
# reads, so a copy is checked.
check_source() {
    local file
    [[ -f $source/release && -f $source/SHA256SUMS ]] ||
        fail "no release in $source. Name the folder that 'make release' wrote; on a stick it is bunraku/release."
    head=$(mktemp -d)
    for file in release SHA256SUMS SHA256SUMS.sig; do
        [ ! -f "$source/$file" ] || take "$source/$file" "$head/$file" "$HEAD_BYTES" ||
            fail "$file could not be read from $source. Nothing was changed. Copy the release to the stick again."
    done
    check_signature
    (cd "$head" && grep '  \./release$' SHA256SUMS | sha256sum --check --strict --status) ||
        fail "the file 'release' in $source is damaged. Nothing was changed. Copy the release to the stick again."
    version=$(fact "$head" version)
    [[ $version =~ ^[0-9A-Za-z.+]+$ ]] || fail "the release in $source has no version. Copy it to the stick again."
}

# One file of a stick, which may hold anything: not through a link, at most $3 bytes, without waiting for a pipe.
take() { dd if="$1" of="$2" bs=1M count="$3" iflag=nofollow,nonblock,fullblock,count_bytes status=none; }

signature() { ssh-keygen -Y "$@" -n "$signed_as" -s "$head/SHA256SUMS.sig" <"$head/SHA256SUMS" 2>/dev/null; }

# By the keys that the release on this box names; a box that forgets its root has them with its release.
check_signature() {
    local with trusted=$root$home/current/keys
    if [ "$unsigned" = yes ]; then
        say "--unsigned: who made this release is not checked. Whoever wrote the stick will have this box."
        return
    fi
    [ -f "$head/SHA256SUMS.sig" ] ||
        fail "the release in $source is not signed: anybody could have made it. Nothing was changed." \
            "Ask its maker for a signed one; one that you have made yourself is taken with --unsigned."
    command -v ssh-keygen >/dev/null ||
        fail "ssh-keygen is missing, which checks who made a release. Nothing was changed." \
            "On Debian: apt-get install openssh-client"
    with=$(signature check-novalidate | grep -o 'SHA256:[0-9A-Za-z+/]*$') ||
        fail "the release in $source is not what its maker signed. Nothing was changed. Copy it to the stick again."
    if [ -n "$key" ]; then
        [ "$with" = "$key" ] ||
            fail "the release in $source is signed with the key $with, not with $key. Nothing was changed."
    elif [ -f "$trusted" ]; then
        signature verify -f "$trusted" -I release >/dev/null ||
            fail "the release in $source is signed with the key $with, which this box does not know." \
                "Nothing was changed. Does its maker have a new key? Ask, by another way than this stick, and" \
                "compare; then: --key $with"
    else
        say "this box knows no key yet. This release is signed with the key $with: compare that with what its maker" \
            "says. From now on the box takes releases by the keys that this one names."
    fi
    grep -q '  \./keys$' "$head/SHA256SUMS" ||
        fail "the release in $source names no keys for the releases after it. Nothing was changed." \
            "Ask its maker to sign it with deploy/release/sign."
}

# A stick with an old release is taken by mistake, or brings back a fault that was mended.
check_age() {
    local now
    [[ $older = no && -f $releases/$(current)/release ]] || return 0
    now=$(fact "$releases/$(current)" version)
    in_root dpkg --compare-versions "$version" ge "$now" ||
        fail "bunraku $version in $source is older than $now, which dances. Nothing was changed. Is it the right" \
            "stick? A release that this box still has comes back with --use (--list names them); this one with --older."
}

check_machine() {
    local python arch have
    arch=$(in_root dpkg --print-architecture) || fail "this is neither Debian nor Raspberry Pi OS."
    [ "$arch" = "$(fact "$head" architecture)" ] ||
        fail "this box is $arch, the release is for $(fact "$head" architecture). Take the release for $arch."
    python=$(fact "$head" python)
    in_root "/usr/bin/python$python" -c 'import venv' 2>/dev/null ||
        fail "Python $python is missing. Bunraku is made for Debian 13; there: apt-get install libpython3-stdlib"
    check_shared_memory
    [[ $store = "$releases" ]] || check_data
    check_lasts
    needs=$(fact "$head" needs-mb)
    have=$(df --output=avail -m "$store" | tail -n 1 | tr -d ' ')
    [ "$have" -ge "$needs" ] || fail "$have MB are free in $store, $needs MB are needed." \
        "Nothing was changed. Make room, or use a larger card."
}

# Files that a release needs during its trial, and would only miss minutes later.
check_shared_memory() {
    in_root sh -c 'touch /dev/shm/.bunraku-install && rm /dev/shm/.bunraku-install' 2>/dev/null ||
        fail "$root/dev/shm is missing, or cannot be written: the release cannot be tried. Nothing was changed." \
            "mkdir -p $root/dev/shm && mount -t tmpfs tmpfs $root/dev/shm"
}

# A box forgets nothing overnight: sensors' keys above all.
check_lasts() {
    local memory
    if [[ -n $root || $fleeting = yes ]]; then return; fi
    memory=$(memory_of /data)
    [ -z "$memory" ] ||
        fail "/data is in memory ($memory): sensors' keys, shows and the journal would be gone at power-off." \
            "Nothing was changed. Give it a partition: --data /dev/sda1, and keep the overlay off it" \
            "(overlayroot=tmpfs:recurse=0 in the kernel's command line). For a trial: --until-power-off"
}

check_data() {
    has_data ||
        fail "this box runs from a read-only image, and its data partition, where releases are kept, is not there." \
            "Look at its disk: bunraku doctor. As long as the power is on it can be tried: --until-power-off"
    { mkdir -p "$kept" && [ -w "$kept" ]; } 2>/dev/null ||
        fail "$kept cannot be written. Nothing was changed. Ask bunraku doctor."
    belongs_to_root "$root/data" "$kept" ||
        fail "others than root may write into /data or $kept, and what lies there would be started as root." \
            "Nothing was changed. chown root: and chmod 755 both."
}

belongs_to_root() { [ "$(stat -c %u:%a "$@" | sort -u)" = 0:755 ]; }

# ---- a separate release next to the others

copy_and_verify() {
    local file from left=$((needs << 20)) # a file that has grown on the stick does not fill the disk
    from=$(realpath "$source")
    mkdir -p "$part"
    mkdir -m 700 "$part/source" # root may read files that are not for everybody
    while read -r _ file; do
        file=${file#./}
        [ "$(realpath -m "$source/$file")" = "$from/$file" ] ||
            fail "the release in $source leads out of its folder by '$file', which no release does. Nothing was" \
                "installed. Do not use this stick."
        mkdir -p "$(dirname "$part/source/$file")"
        take "$source/$file" "$part/source/$file" "$left" ||
            fail "$file could not be read from $source. Is the stick still in? The box dances as before."
        left=$((left - $(stat -c %s "$part/source/$file")))
    done <"$head/SHA256SUMS"
    (cd "$part/source" && sha256sum --check --strict --quiet "$head/SHA256SUMS" >&2) ||
        fail "files of the release are damaged (named above). Copy it to the stick again. The box dances as before."
    install -m 644 "$head/SHA256SUMS" "$part/source/"
}

# A wheel is an archive of files for site-packages; each was checked against its sum before.
UNPACK='import sys, zipfile
for wheel in sys.argv[2:]:
    zipfile.ZipFile(wheel).extractall(sys.argv[1])'

build() {
    local inside=${part#"$root"} file wheels=("$part"/source/wheels/*.whl)
    in_root "/usr/bin/python$(fact "$part/source" python)" -m venv --without-pip "$inside"
    site=$(echo "$part"/lib/python3*/site-packages)
    in_root "$inside/bin/python" -I -c "$UNPACK" "${site#"$root"}" "${wheels[@]#"$root"}" ||
        fail "the packages could not be unpacked (above). The box dances as before."
    drop_unneeded
    write_command
    in_root "$inside/bin/python" -I -m compileall -q -j 0 -s "$inside" -p "$home/releases/$name" "$inside/lib" ||
        fail "a part of bunraku $version cannot be read by Python (above). The box dances as before."
    # The built-in show's start-up data is computed now, not at each power-on.
    in_root "$inside/bin/python" -I -m appliance.cli.prepare_show ||
        echo "The show that comes with the box is not prepared (above): the box starts somewhat slower."
    for file in system release SHA256SUMS install.sh; do mv "$part/source/$file" "$part/"; done
    keep_keys
    chmod 755 "$part/install.sh"
    rm -rf "$part/source" "$part/.gitignore" "$part/include"
}

# Whose releases are taken after this one. One that nobody vouches for has no say in it.
keep_keys() {
    local from=$part/source/keys
    [ "$unsigned" = no ] || from=$root$home/current/keys
    [ ! -f "$from" ] || install -m 644 "$from" "$part/keys"
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

# Built as VERSION.part and renamed when whole, so the command names the final folder from the start.
write_command() {
    find "$part/bin" -type f -delete
    printf '#!%s/bin/python -I\nimport sys\n\nfrom appliance.start import main\n\nsys.exit(main())\n' \
        "$home/releases/$name" >"$part/bin/bunraku"
    chmod 755 "$part/bin/bunraku"
}

# On the box it dances a moment out of sight; in an image, whose machine is another one, it loads every part, and
# under emulation, which has no processor that onnxruntime knows (it ends with SIGSEGV), its command alone.
works() {
    local python=$1/bin/python meeting result=0 as=()
    if [[ -n $root && $(in_root dpkg --print-architecture) != $(dpkg --print-architecture) ]]; then
        in_root "$python" -I -c 'import appliance.start'
    elif [ -n "$root" ]; then
        in_root "$python" -I -c 'import importlib, pkgutil, appliance
for module in pkgutil.walk_packages(appliance.__path__, "appliance."):
    if not module.name.startswith("appliance.studio"):
        importlib.import_module(module.name)'
    else
        meeting=$(mktemp -d)
        # It loads the shows on this box, which are not root's.
        if id bunraku >/dev/null 2>&1; then
            as=(setpriv --reuid bunraku --regid bunraku --init-groups --no-new-privs)
            chown bunraku "$meeting"
        fi
        RUNTIME_DIRECTORY=$meeting timeout 60 "${as[@]}" "$python" -I -m appliance.cli preflight --check-release ||
            result=$?
        rm -rf "$meeting"
        return $result
    fi
}

install_release() {
    local number
    check_source
    check_age
    check_machine
    name=$version
    if [ -d "$releases/$name" ] && ! cmp -s "$releases/$name/SHA256SUMS" "$head/SHA256SUMS"; then
        name=$version-$(sha256sum <"$head/SHA256SUMS" | cut -c 1-8)
    fi
    if [[ -L $releases/$name && -n $(flaw "$name") ]]; then discard "$name"; fi
    if [ ! -d "$releases/$name" ]; then
        rm -rf "${store:?}/$name" "$store"/*.part
        part=$store/$name.part
        say "bunraku $version: reading $source and checking every file"
        copy_and_verify
        say "unpacking it beside the release that dances"
        build
        number=$(installed | tail -n 1 | cut -d ' ' -f 1)
        echo $((${number:-0} + 1)) >"$part/number"
        say "trying it"
        works "${part#"$root"}" ||
            fail "bunraku $version does not work on this box (above). The box dances as before."
        if [ "$store" = "$kept" ]; then contents "$part" >"$part/whole"; fi
        sync -f "$part"
        mv "$part" "$store/$name"
        part='' fresh=yes
        sync -f "$store"
        link_kept
    fi
    switch_or_go_back "$name"
    forget_old
    if [ -z "$root" ] && ! forgets && ! has_data; then
        say "/data lies on the system's own partition. Before you switch a read-only root on, give it one of its own," \
            "or the box forgets its sensors each night: bunraku-install --data PARTITION (docs/touring.md)"
    fi
}

# ---- a place that lasts

# The partition becomes /data, with what is there now. Nothing is formatted: a wrong letter would cost a disk.
use_partition() {
    local kind uuid moved=no
    [ -b "$partition" ] || fail "there is no partition '$partition': lsblk -f shows which there are. Nothing was changed."
    kind=$(blkid -o value -s TYPE "$partition" || true) uuid=$(blkid -o value -s UUID "$partition" || true)
    [[ $kind = ext4 && -n $uuid ]] ||
        fail "$partition has ${kind:-no file system}, ext4 is needed. Nothing was changed." \
            "If nothing on it is needed any more: mkfs.ext4 -L data $partition"
    ! has_data || fail "/data has a partition already ($(findmnt -n -o SOURCE "$root/data")). Nothing was changed."
    [[ -n $root || -z $(memory_of /etc/fstab) ]] ||
        fail "what is written to /etc is gone at power-off: switch the read-only root off first (raspi-config)," \
            "restart, and call this again. Nothing was changed."
    ! grep -qE '^[^#]*[[:space:]]/data[[:space:]]' "$root/etc/fstab" 2>/dev/null ||
        fail "$root/etc/fstab names /data already. Mend its line, then: mount /data. Nothing was changed."
    mkdir -p "$root/data" "$root/mnt"
    if runs_here; then systemctl stop bunraku.target 'bunraku-*' || true; fi
    mount -t ext4 "$partition" "$root/mnt"
    if [ -d "$root/data/bunraku" ] && [ ! -e "$root/mnt/bunraku" ]; then
        cp -a "$root/data/." "$root/mnt/" || { umount "$root/mnt" && fail "$partition has no room for what is in /data."; }
        moved=yes
    fi
    umount "$root/mnt"
    echo "UUID=$uuid  /data  ext4  rw,noatime,nosuid,nodev,commit=5,errors=remount-ro,nofail  0  2" >>"$root/etc/fstab"
    mount -t ext4 -o rw,noatime,nosuid,nodev "$partition" "$root/data"
    check_written
    if runs_here; then systemctl daemon-reload && systemctl start --no-block bunraku.target || true; fi
    say "/data is on $partition from now on, and at each power-on$([ $moved = no ] || echo ', with what was in it')"
}

# Written, brought to the disk, and read again after the partition was taken away and put back.
check_written() {
    local word
    word=$(head -c 16 /dev/urandom | od -An -tx1 | tr -d ' \n')
    echo "$word" >"$root/data/.lasts"
    sync "$root/data/.lasts"
    umount "$root/data"
    mount -t ext4 -o rw,noatime,nosuid,nodev "$partition" "$root/data"
    [[ $(<"$root/data/.lasts") = "$word" && -z $(memory_of "$root/data") ]] ||
        fail "$partition does not keep what is written to it. Take another one: /etc/fstab names this one now."
    rm "$root/data/.lasts"
}

# ---- the switch

# System files under usr/ are links through `current`: renaming that one link switches all of them at once.
# Those under etc/ are copies: other daemons may not read elsewhere, and a technician may change them.
system_files() { (cd "$releases/$1/system" && find usr etc -type f) 2>/dev/null || true; }

link() {
    mkdir -p "$(dirname "$2")"
    ln -sfn "$1" "$2.new"
    mv -T "$2.new" "$2"
}

# $1 the file, $2 the release before: what was changed on this box stays as it is.
copy() {
    local new=$releases/$name/system/$1 old=$releases/$2/system/$1 here=$root/$1
    if [ -e "$here" ] && ! cmp -s "$here" "$new" && ! cmp -s "$here" "$old"; then
        say "/$1 was changed on this box and stays; compare it with $home/current/system/$1"
        return
    fi
    mkdir -p "$(dirname "$here")"
    install -m "$(case $1 in *.nmconnection) echo 600 ;; *) echo 644 ;; esac)" "$new" "$here.new"
    mv -T "$here.new" "$here"
}

# One of the last lines of a unit ([Install] WantedBy=), so that it starts with the box.
enable_units() {
    local file target
    { (cd "$releases/$name/system" && grep -sH '^WantedBy=' "$units"/*) || true; } | while IFS=: read -r file target; do
        link "/$file" "$root/etc/systemd/system/${target#WantedBy=}.wants/${file##*/}"
    done
}

# Every folder in which a release of this box has a link.
folders_of_links() {
    local file
    { echo usr/local/bin/x && echo usr/local/sbin/x
      for file in "$releases"/*/; do system_files "$(basename "$file")"; done; } |
        sed 's|/[^/]*$||' | sort -u
}

# Links through `current` that are there, as "where<tab>to": a path may have spaces.
links() {
    local folder folders=()
    while read -r folder; do
        if [ -d "$root/$folder" ]; then folders+=("$root/$folder"); fi
    done < <(folders_of_links)
    [ ${#folders[@]} = 0 ] || find "${folders[@]}" -maxdepth 1 -type l -lname "$home/current/*" -printf '%p\t%l\n'
}

# Links that the chosen release does not have any more, and what a power cut left.
unlink_left_over() {
    local where to
    links | while IFS=$'\t' read -r where to; do [[ -e $root$to && $where != *.new ]] || rm "$where"; done
    find "$root/etc/systemd/system" -type l -lname "/$units/*" -printf '%p\t%l\n' |
        while IFS=$'\t' read -r where to; do [[ -L $root$to || -e $root$to ]] || rm "$where"; done
}

switch_to() {
    local file before where to
    local -A linked=()
    name=$1 before=$(current)
    while IFS=$'\t' read -r where to; do linked[$where]=$to; done < <(links)
    while read -r file; do
        case $file in
        usr/*)
            to=$home/current/system/$file
            [ "${linked[$root/$file]:-}" = "$to" ] || link "$to" "$root/$file"
            ;;
        *) copy "$file" "$before" ;;
        esac
    done < <(system_files "$name")
    enable_units
    link "$home/current/bin/bunraku" "$root/usr/local/bin/bunraku"
    link "$home/current/install.sh" "$root/usr/local/sbin/bunraku-install"
    if [[ -f $releases/$name/$users && -x $root/usr/bin/systemd-sysusers ]]; then
        in_root systemd-sysusers "$home/releases/$name/$users"
    fi
    sync -f "$root/etc" "$root/usr"
    link "releases/$name" "$root$home/current"
    sync -f "$root$home"
    unlink_left_over
}

is_active() { [ "$(systemctl show --property ActiveState --value bunraku-stage)" = active ]; }
main_pid() { systemctl show --property MainPID --value bunraku-stage; }

read_system_files() {
    systemctl daemon-reload
    systemd-tmpfiles --create "$home/current/system/usr/lib/tmpfiles.d/bunraku.conf" || true
    udevadm control --reload 2>/dev/null || true # a container has no udev
}

# True when the stage dances and goes on dancing; in an image there is nothing to start.
starts() {
    local pid before deadline=$((SECONDS + STARTS_WITHIN_S))
    runs_here || return 0
    read_system_files
    before=$(main_pid)
    systemctl reset-failed bunraku-stage || true # what it counted until now is not this one's
    systemctl restart --no-block bunraku.target || true
    until pid=$(main_pid) && is_active && [ "$pid" != "$before" ]; do
        [ "$SECONDS" -lt "$deadline" ] || return 1
        [ "$(restarts)" -lt "$STARTS_TRIED" ] || return 1
        sleep 0.2
    done
    sleep "$STAYS_S"
    is_active && [ "$(main_pid)" = "$pid" ]
}

switch_or_go_back() {
    local before
    before=$(current)
    switch_to "$1"
    if starts; then
        keep_choice "$1"
        say "bunraku $1 is installed$(runs_here && echo ' and dances')"
        return
    fi
    journalctl --unit bunraku-stage --lines 15 --no-pager --output cat >&2 || true
    [[ -n $before && $before != "$1" && -d $releases/$before ]] ||
        fail "bunraku $1 did not start (above). There is no release before it on this box."
    switch_to "$before"
    [ "$fresh" = no ] || discard "$1"
    starts || fail "bunraku $1 did not start (above), and $before does not start now either. Ask bunraku doctor."
    fail "bunraku $1 did not start (above). Back on $before, which dances. Report what stands above."
}

# Only an image's releases on the data partition count; its own stays.
forget_old() {
    local name
    for name in $(installed | cut -d ' ' -f 2 | grep -vxF "$(current)" |
        { if forgets; then grep -vxF "$(own)" || true; else cat; fi; } | head -n -"$KEPT"); do
        discard "$name"
    done
}

# Under another name first: whenever the power fails, no half release is taken for a whole one.
discard() {
    local folder=${releases:?}/$1
    if [ -L "$folder" ]; then rm "$folder" && folder=${kept:?}/$1 && rm -f "$folder.aside"; fi
    mv "$folder" "$folder.part"
    rm -rf "$folder.part"
}

# ---- a box made from the image: its root forgets, its data partition does not

# Facts about every file of a release: kind, permissions, owner, size, name, and a link's target.
contents() {
    (cd "$1" && find . -mindepth 1 -not -name whole \( -type d -printf 'd %m %U %P\n' -o \
        -printf '%y %m %U %s %P %l\n' \) | LC_ALL=C sort)
}

# Why a release on the data partition is not to be switched to; nothing when it is sound. To read all of it would
# cost seconds at power-on: of most files only the size counts, of those that systemd reads every byte. A stage that
# does not dance with the rest is put aside by the watch.
flaw() {
    local folder=$kept/$1
    [ -f "$folder/whole" ] || { echo "it is not whole" && return; }
    [ -L "$releases/$1" ] || { echo "the image came with another one of this name" && return; }
    belongs_to_root "$root/data" "$kept" "$folder" || { echo "others than root may write there" && return; }
    [ -z "$(contents "$folder" | LC_ALL=C comm -13 - "$folder/whole")" ] ||
        { echo "files of it are missing or damaged" && return; }
    (cd "$folder" && grep -E '  \./(system/|release$|install\.sh$)' SHA256SUMS | sha256sum --check --strict --status) ||
        { echo "what systemd reads of it is damaged" && return; }
    [ "$(in_root dpkg --print-architecture)" = "$(fact "$folder" architecture)" ] ||
        { echo "it is for $(fact "$folder" architecture)" && return; }
    [ -x "$root/usr/bin/python$(fact "$folder" python)" ] || echo "it needs Python $(fact "$folder" python)"
}

# The show and box file that this box uses at the next power-on.
keep_choice() {
    if ! forgets || [[ $fleeting = yes || ! -d $kept ]]; then return; fi
    if [ -L "$releases/$1" ]; then
        rm -f "$kept/tries" "$kept/$1.aside"
        link "$1" "$kept/current"
    else
        rm -f "$kept/current" "$kept/tries"
    fi
    sync -f "$kept"
}

# $2 says why; from now on the image's own release dances.
put_aside() {
    say "bunraku $1 is put aside: $2. The release that came with the image dances." \
        "Install it again, or try it once more: bunraku-install --use $1"
    { echo "$2" >"$kept/$1.aside" && keep_choice "$(own)"; } 2>/dev/null ||
        say "The data partition cannot be written: it is tried again at the next power-on."
}

# Before anything dances, once. The system files are reread only where they differ from the image's.
at_power_on() {
    local name why tries=0
    forgets || return 0
    if runs_here; then : >"$once"; fi
    name=$(basename "$(readlink "$kept/current")")
    why=$(flaw "$name")
    if [ -n "$why" ]; then
        put_aside "$name" "$why"
        return
    fi
    [ ! -s "$kept/tries" ] || tries=$(tr -cd 0-9 <"$kept/tries" | head -c 3)
    if [ "${tries:-0}" -ge "$POWER_ONS_TRIED" ]; then
        put_aside "$name" "it did not dance for $DANCES_FOR_S s in $POWER_ONS_TRIED power-ons"
        return
    fi
    { echo $((10#${tries:-0} + 1)) >"$kept/tries"; } 2>/dev/null || true
    if diff -qr "$releases/$(current)/system" "$releases/$name/system" >/dev/null; then
        link "releases/$name" "$root$home/current"
        start_watch "$name"
    else
        switch_to "$name"
        start_watch "$name"
        if runs_here; then read_system_files && systemctl --no-block start bunraku.target; fi
    fi
    say "bunraku $name, from the data partition"
}

# By the image's own script, whatever the release is.
start_watch() {
    runs_here || return 0
    systemd-run --quiet --no-block --unit=watch-release --description="Does bunraku $1 dance?" \
        --property=After=bunraku-preflight.service "$releases/$(own)/install.sh" --watch "$1"
}

restarts() { systemctl show --property NRestarts --value bunraku-stage; }

# True as soon as the stage has danced for a moment, or when it was stopped on purpose; false when it does not dance.
danced() {
    local pid='' now since=0 deadline=$((SECONDS + DANCES_WITHIN_S))
    while [ "$SECONDS" -lt "$deadline" ] && [ "$(restarts)" -lt "$STARTS_TRIED" ]; do
        sleep 1
        if is_active; then now=$(main_pid); else now=''; fi
        [[ -n $now && $now = "$pid" ]] || since=$SECONDS
        pid=$now
        if [ $((SECONDS - since)) -ge "$DANCES_FOR_S" ]; then return 0; fi
    done
    [ "$(systemctl show --property ActiveState --value bunraku-stage)" = inactive ]
}

watch() {
    sync -f "$kept" || true
    if danced; then
        rm -f "$kept/tries"
        return
    fi
    begin
    [ "$(current)" = "$1" ] || return 0
    put_aside "$1" "its stage did not dance"
    switch_to "$(own)"
    starts || fail "the release that came with the image does not start either. Ask bunraku doctor."
}

# ---- what else one can ask for

list() {
    local name sign
    while read -r _ name; do
        if [ "$name" = "$(current)" ]; then sign='*'; else sign=' '; fi
        echo "$sign $name$([ ! -f "$kept/$name.aside" ] || echo "  put aside: $(<"$kept/$name.aside")")"
    done < <(installed)
    [ -n "$(installed)" ] || say "no release is on this box"
}

use() {
    local why
    [ -f "$releases/$1/number" ] ||
        fail "no release '$1' on this box. It has: $(installed | cut -d ' ' -f 2 | xargs | grep . || echo none)."
    if [ -L "$releases/$1" ]; then
        why=$(flaw "$1")
        [ -z "$why" ] || fail "bunraku $1: $why. The box dances as before. Install it again."
    fi
    switch_or_go_back "$1"
}

rollback() {
    local before now
    now=$(current)
    [ -n "$now" ] || fail "no release is on this box."
    before=$(installed | cut -d ' ' -f 2 | grep -xF -B 1 "$now" | head -n 1) || true
    [[ -n $before && $before != "$now" ]] || fail "no release before $now on this box. The box dances as before."
    use "$before"
}

uninstall() {
    local file
    [[ -n $(current) || $purge = yes ]] || fail "no release is on this box. Nothing was changed."
    if forgets; then
        uninstall_kept
        return
    fi
    if runs_here; then
        systemctl stop bunraku.target 'bunraku-*' || true
    fi
    while read -r file; do
        case $file in etc/*) cmp -s "$root/$file" "$releases/$(current)/system/$file" && rm "$root/$file" ;; esac
    done < <(system_files "$(current)")
    rm -f "$root$home/current"
    unlink_left_over
    rm -rf "${root:?}$home"
    runs_here && systemctl daemon-reload
    say "bunraku is off this box"
    if [ "$purge" = yes ]; then rm -rf "${root:?}$data" && say "and so are all shows, keys and the journal"; fi
}

# The release that came with the image stays, and dances.
uninstall_kept() {
    local name
    if [ "$purge" = yes ]; then
        ! runs_here || systemctl stop bunraku.target 'bunraku-*' || true
        rm -rf "${root:?}$data"
    fi
    switch_or_go_back "$(own)"
    for name in $(installed | cut -d ' ' -f 2); do [ ! -L "$releases/$name" ] || discard "$name"; done
    rm -rf "${kept:?}"
    say "nothing but what came with the image is on this box$([ "$purge" = no ] || echo ': all shows, keys and the journal are gone')"
}

main() {
    read_options "$@"
    case $action in list | watch) ;; *) begin ;; esac
    case $action in
    install) install_release ;;
    at-power-on) at_power_on ;;
    watch) watch "$chosen" ;;
    list) list ;;
    rollback) rollback ;;
    use) use "$chosen" ;;
    data) use_partition ;;
    uninstall) uninstall ;;
    esac
    exit 0
}

main "$@"
