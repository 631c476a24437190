#!/bin/bash
# Builds the root of a box: Debian 13, what the box needs of it, and a release of bunraku installed into it.
# shellcheck disable=SC2016  # $1 and ${Package} below are for other programs than this shell
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)

usage() {
    cat <<'END'
usage: mkroot.sh [--arch amd64|arm64] [--without-kernel] --deb FILE [--debian TAR] OUT

Builds the root file system of a box into the folder OUT.

  --arch ARCH        amd64 (default) or arm64. A foreign one's packages are unpacked, and what their own scripts
                     would do is done from here: of that processor's programs only three run (qemu-user-static).
  --without-kernel   no kernel, no firmware: for systemd-nspawn
  --deb FILE         the package of a box that `make deb` made
  --debian TAR       keeps Debian's part in TAR, and takes it from there the next time

Must run as root, with mmdebstrap. Debian packages come from where this machine's own come from
(MIRROR="deb URL trixie main" names another place), Python packages from where pip takes them.
END
}

fail() {
    printf 'mkroot: %s\n' "$*" >&2
    exit 1
}

arch=amd64 kernel=yes deb='' debian='' out=''
while [ $# -gt 0 ]; do
    case $1 in
        --arch) arch=${2:?--arch needs amd64 or arm64}; shift 2 ;;
        --without-kernel) kernel=no; shift ;;
        --deb) deb=${2:?--deb needs a file}; shift 2 ;;
        --debian) debian=${2:?--debian needs a file}; shift 2 ;;
        --help | -h) usage; exit 0 ;;
        -*) fail "unknown option $1. See mkroot.sh --help." ;;
        *) out=$1; shift ;;
    esac
done
[[ -n $out && -n $deb ]] || { usage >&2; exit 2; }
root=$(realpath -m "$out") # dpkg's scripts do not find a relative one
[ "$(id -u)" = 0 ] || fail "needs root: it makes device nodes and installs packages into a new root."
command -v mmdebstrap >/dev/null || fail "mmdebstrap is missing. Install it: apt-get install mmdebstrap"
case $arch in
    amd64) machine=x86_64 extra=pc ;;
    arm64) machine=aarch64 extra=pi ;;
    *) fail "--arch $arch: a box is amd64 or arm64." ;;
esac
foreign=no
[ "$arch" = "$(dpkg --print-architecture)" ] || foreign=yes
[ $foreign = no ] || command -v "qemu-$machine-static" >/dev/null ||
    fail "qemu-$machine-static is missing. Install it: apt-get install qemu-user-static"
# shellcheck disable=SC2034 # where targets.sh keeps the target's Python
checkout=$repository
# shellcheck source=deploy/release/targets.sh
source "$repository/deploy/release/targets.sh"

# Names of a list of packages or paths, without its comments.
listed() { sed -e 's/#.*//' "$here/$1" | tr -s ' \n' '\n' | sed '/^$/d'; }

sources() {
    if [ -n "${MIRROR:-}" ]; then
        printf '%s\n' "$MIRROR"
        return
    fi
    local debian security
    debian=$(mirror Debian) security=$(mirror Debian-Security)
    [ -n "$debian" ] || fail "no Debian mirror among this machine's apt sources. Name one: MIRROR='deb URL trixie main'"
    printf 'deb %s trixie main non-free-firmware\n' "$debian"
    [ "$extra" != pi ] || printf 'deb %s trixie-backports main\n' "$debian"
    [ -z "$security" ] || printf 'deb %s trixie-security main non-free-firmware\n' "$security"
}

work=$(mktemp -d "${TMPDIR:-/tmp}/bunraku-root.XXXXXX")
trap 'rm -rf "$work"' EXIT
mkdir -p "$(dirname "$root")"

debian() {
    local options=(--variant=apt) hooks=() pattern packages
    while read -r pattern; do
        case $pattern in
            +*) options+=(--dpkgopt="path-include=${pattern#+}") ;;
            *) options+=(--dpkgopt="path-exclude=$pattern") ;;
        esac
    done < <(listed drop-files.txt)
    packages=$(listed packages-box.txt)
    [ "$kernel" = no ] || packages+=$'\n'$(listed "packages-$extra.txt")
    if [ $foreign = yes ]; then
        options+=(--variant=extract --skip=cleanup/apt)
        packages+=$'\n?essential'
    elif [ "$kernel" = yes ]; then
        # Before the kernel comes: its start image is made from these files.
        hooks=(--essential-hook="cp -a --no-preserve=ownership '$here/tree/.' \"\$1/\"")
    fi
    echo "Debian 13 for $arch into $root"
    sources | mmdebstrap --quiet --architectures="$arch" "${options[@]}" \
        --aptopt='Acquire::Languages "none"' --aptopt='APT::Install-Recommends "false"' \
        --dpkgopt=force-confold --include="$(tr '\n' ',' <<<"$packages" | sed 's/,$//')" \
        "${hooks[@]}" trixie "$root" - >"$work/debian.log" 2>&1 ||
        { tail -n 30 "$work/debian.log" >&2; fail "Debian could not be installed; the lines above say why."; }
    [ $foreign = no ] || settle_unpacked
}

# Does the work of the packages' own scripts, which would run for an hour in an emulated processor.
settle_unpacked() {
    local package name of=$root/var/lib/dpkg
    cp -a --no-preserve=ownership "$here/tree/." "$here/tree-$extra/." "$root/"
    for package in "$root"/var/cache/apt/archives/*.deb; do
        name=$(dpkg-deb -f "$package" Package)
        [ "$(dpkg-deb -f "$package" Multi-Arch)" != same ] || name+=:$arch
        { dpkg-deb -f "$package" | sed '/^Package:/a Status: install ok installed' && echo; } >>"$of/status"
        dpkg-deb --fsys-tarfile "$package" | tar -t | sed 's|^\./|/|; s|^/$|/.|; s|\(.\)/$|\1|' >"$of/info/$name.list"
    done
    users "$repository/deploy/system/usr/lib/sysusers.d/bunraku.conf" # first, because its number is fixed
    cp "$root/usr/share/libc-bin/nsswitch.conf" "$root/usr/share/base-files/profile" "$root/etc/"
    cp "$root"/usr/share/chrony/chrony.{conf,keys} "$root/etc/chrony/"
    chmod 640 "$root/etc/chrony/chrony.keys"
    ln -sf mawk "$root/usr/bin/awk"
    ln -sf regulatory.db-debian "$root/usr/lib/firmware/regulatory.db"
    ln -sf regulatory.db.p7s-debian "$root/usr/lib/firmware/regulatory.db.p7s"
    rm -rf "$root/etc/init.d" # systemctl would ask a program of the root about it
    for name in NetworkManager avahi-daemon chrony wpa_supplicant; do
        systemctl --root="$root" enable "$name.service" >/dev/null 2>&1 || fail "$name.service cannot be enabled."
    done
    target_python -m compileall -q -s "$root" -p / --invalidation-mode unchecked-hash "$root/usr/lib/python$PYTHON" \
        "$root/usr/lib/python3"
}

debian_kept() {
    if [ -n "$debian" ] && [ -f "$debian" ]; then
        mkdir -p "$root"
        tar -C "$root" --numeric-owner -xpf "$debian"
        return
    fi
    debian
    if [ -n "$debian" ]; then
        tar -C "$root" --numeric-owner -cf "$debian.part" .
        mv "$debian.part" "$debian"
    fi
}

# An older systemd than the box's does not know `u!`.
users() { cat "$@" "$root"/usr/lib/sysusers.d/*.conf | sed 's/^u!/u/' | systemd-sysusers --root="$root" - 2>/dev/null; }

# The package as on any box.
install_release() {
    if [ $foreign = yes ]; then
        dpkg --root="$root" --force-script-chrootless --force-architecture --no-triggers --install "$deb" &&
            prepare_show
    else
        cp "$deb" "$root/bunraku.deb"
        chroot "$root" dpkg --install /bunraku.deb
        rm "$root/bunraku.deb"
    fi >"$work/release.log" 2>&1 || { tail -n 20 "$work/release.log" >&2; fail "$deb could not be installed."; }
}

settle() {
    echo bunraku >"$root/etc/hostname"
    printf '127.0.0.1 localhost bunraku\n::1 localhost\n' >"$root/etc/hosts"
    : >"$root/etc/machine-id"
    rm -f "$root/etc/resolv.conf" "$root/var/lib/dbus/machine-id" "$root/usr/bin/ssh-agent"
    mkdir -p "$root/data" "$root/media/bunraku"
    # Anyone who can plug a keyboard into the box could take its disk as well: there is no password and no
    # ssh.
    sed -i 's|^root:[^:]*:|root::|' "$root/etc/shadow"
    systemctl --root="$root" set-default multi-user.target >/dev/null 2>&1
    systemctl --root="$root" mask getty@tty1.service systemd-random-seed.service apt-daily.timer \
        apt-daily-upgrade.timer dpkg-db-backup.timer e2scrub_all.timer fstrim.timer \
        NetworkManager-wait-online.service >/dev/null 2>&1
    dpkg-query --admindir="$root/var/lib/dpkg" --show --showformat '${Package} ${Version} ${Installed-Size}\n' >"$root/etc/bunraku-packages"
    echo LANG=C.UTF-8 >"$root/etc/default/locale"
    rm -rf "$root"/var/lib/apt/lists/* "$root"/var/cache/* "$root"/var/log/* "$root"/tmp/*
    first_start_done
}

# The built-in show's start-up data, which the package's own script computes where its Python runs.
prepare_show() {
    cp "$(command -v "qemu-$machine-static")" "$root/emulator"
    chroot "$root" /emulator -cpu cortex-a72 /opt/bunraku/current/bin/python -I -m appliance.cli.prepare_show
    rm "$root/emulator"
}

# A program of the root, in an emulated processor.
emulated() { "qemu-$machine-static" -L "$root" "$(PATH=$root/usr/sbin:$root/usr/bin command -v "$1")" "${@:2}"; }

# systemd's one-time work after a change of /usr takes a second; a root in memory would repeat it at each
# start.
first_start_done() {
    if [ $foreign = no ]; then
        chroot "$root" systemd-sysusers
        chroot "$root" journalctl --quiet --update-catalog
        chroot "$root" ldconfig
    else
        journalctl --quiet --root="$root" --update-catalog
        emulated systemd-hwdb --root="$root" --usr update
        emulated ldconfig -r "$root"
    fi
    # The mark of systemd-update-done, with a fixed time: the same commit gives the same image.
    echo 'TIMESTAMP_NSEC=4102444800000000000' | tee "$root/etc/.updated" >"$root/var/.updated" # until the year 2100
}

debian_kept
install_release
settle
rm -rf "$root/var/cache/ldconfig" # its file has times in it
echo "$root: $(du -sh "$root" | cut -f 1) unpacked"
