#!/bin/bash
# Builds the root of a box: Debian 13, what the box needs of it, and a release of bunraku installed into it.
# shellcheck disable=SC2016  # $(REPO_URI), $1 and ${Package} below are for other programs than this shell
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
repository=$(cd "$here/../.." && pwd)

usage() {
    cat <<'END'
usage: mkroot.sh [--arch amd64|arm64] [--without-kernel] [--release FOLDER] [--key KEY] [--debian TAR] OUT

Builds the root file system of a box into OUT: a tar where OUT ends with .tar, else a folder.

  --arch ARCH        amd64 (default) or arm64. A foreign one needs qemu-user-static, arch-test, binfmt_misc.
  --without-kernel   no kernel, no firmware: for systemd-nspawn, or for a Raspberry Pi's own boot partition
  --release FOLDER   what `make release` made; left out: one made now from the working tree
  --key KEY          sign that one, so that the box knows whose releases it takes; --next-key KEY.pub as there
  --debian TAR       keeps Debian's part in TAR, and takes it from there the next time

Must run as root, with mmdebstrap. Debian packages come from where this machine's own come from
(MIRROR="deb URL trixie main" names another place), Python packages from where pip takes them.
END
}

fail() {
    printf 'mkroot: %s\n' "$*" >&2
    exit 1
}

arch=amd64 kernel=yes release='' debian='' out='' signing=()
while [ $# -gt 0 ]; do
    case $1 in
        --arch) arch=${2:?--arch needs amd64 or arm64}; shift 2 ;;
        --without-kernel) kernel=no; shift ;;
        --release) release=${2:?--release needs a folder}; shift 2 ;;
        --key | --next-key) signing+=("$1" "${2:?$1 needs a key file}"); shift 2 ;;
        --debian) debian=${2:?--debian needs a file}; shift 2 ;;
        --help | -h) usage; exit 0 ;;
        -*) fail "unknown option $1. See mkroot.sh --help." ;;
        *) out=$1; shift ;;
    esac
done
[ -n "$out" ] || { usage >&2; exit 2; }
[ "$(id -u)" = 0 ] || fail "needs root: it makes device nodes and installs packages into a new root."
command -v mmdebstrap >/dev/null || fail "mmdebstrap is missing. Install it: apt-get install mmdebstrap"
case $arch in
    amd64) machine=x86_64 ;;
    arm64) machine=aarch64; kernel=no ;;
    *) fail "--arch $arch: a box is amd64 or arm64." ;;
esac
if [ "$arch" != "$(dpkg --print-architecture)" ] && ! ls /proc/sys/fs/binfmt_misc/qemu-"$machine" >/dev/null 2>&1; then
    fail "this machine cannot run $arch programs. Install qemu-user-static, binfmt-support and arch-test, mount" \
        "binfmt_misc on /proc/sys/fs/binfmt_misc, and run update-binfmts --enable; or build on such a machine."
fi

# Names of a list of packages or paths, without its comments.
listed() { sed -e 's/#.*//' "$here/$1" | tr -s ' \n' '\n' | sed '/^$/d'; }

sources() {
    if [ -n "${MIRROR:-}" ]; then
        printf '%s\n' "$MIRROR"
        return
    fi
    local debian security
    debian=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Label: Debian' | sort -u | head -n 1)
    security=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Label: Debian-Security' |
        sort -u | head -n 1)
    [ -n "$debian" ] || fail "no Debian mirror among this machine's apt sources. Name one: MIRROR='deb URL trixie main'"
    printf 'deb %s trixie main non-free-firmware\n' "$debian"
    [ -z "$security" ] || printf 'deb %s trixie-security main non-free-firmware\n' "$security"
}

work=$(mktemp -d "${TMPDIR:-/tmp}/bunraku-root.XXXXXX")
trap 'rm -rf "$work"' EXIT
mkdir -p "$(dirname "$out")"
if [[ $out == *.tar ]]; then root=$work/root; else root=$out; fi

debian() {
    local options=() hooks=() pattern packages
    while read -r pattern; do
        case $pattern in
            +*) options+=(--dpkgopt="path-include=${pattern#+}") ;;
            *) options+=(--dpkgopt="path-exclude=$pattern") ;;
        esac
    done < <(listed drop-files.txt)
    packages=$(listed packages-box.txt)
    if [ "$kernel" = yes ]; then
        packages+=$'\n'$(listed packages-pc.txt)
        # Before the kernel comes: its start image is made from these files.
        hooks=(--essential-hook="cp -a --no-preserve=ownership '$here/tree/.' \"\$1/\"")
    fi
    echo "Debian 13 for $arch into $root"
    sources | mmdebstrap --quiet --variant=apt --architectures="$arch" "${options[@]}" \
        --aptopt='Acquire::Languages "none"' --aptopt='APT::Install-Recommends "false"' \
        --dpkgopt=force-confold --include="$(tr '\n' ',' <<<"$packages" | sed 's/,$//')" \
        "${hooks[@]}" trixie "$root" - >"$work/debian.log" 2>&1 ||
        { tail -n 30 "$work/debian.log" >&2; fail "Debian could not be installed; the lines above say why."; }
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

# The release as it would be installed from a stick, made now from the working tree unless one was named.
install_release() {
    local unsigned=()
    if [ -z "$release" ]; then
        release=$work/release
        "$repository/deploy/release/make-release" --arch "$arch" --out "$release" "${signing[@]}"
    fi
    [ -f "$release/SHA256SUMS.sig" ] || unsigned=(--unsigned)
    "$repository/deploy/install.sh" --root "$root" "${unsigned[@]}" "$release"
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
    chroot "$root" dpkg-query --show --showformat '${Package} ${Version} ${Installed-Size}\n' >"$root/etc/bunraku-packages"
    echo LANG=C.UTF-8 >"$root/etc/default/locale"
    rm -rf "$root"/var/lib/apt/lists/* "$root"/var/cache/* "$root"/var/log/* "$root"/tmp/*
    first_start_done
}

# systemd's one-time work after a change of /usr takes a second; a root in memory would repeat it at each
# start.
first_start_done() {
    chroot "$root" systemd-sysusers
    chroot "$root" journalctl --quiet --update-catalog
    chroot "$root" ldconfig
    chroot "$root" /usr/lib/systemd/systemd-update-done
}

debian_kept
install_release
settle
if [[ $out == *.tar ]]; then
    tar -C "$root" --numeric-owner --sort=name -cf "$out.part" .
    mv "$out.part" "$out"
fi
echo "$out: $(du -sh "$root" | cut -f 1) unpacked"
