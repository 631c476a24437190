#!/bin/bash
# Makes the start image of a Raspberry Pi: a shell, the drivers of its disks, and a script that finds the root.
set -euo pipefail

usage() {
    cat <<'END'
usage: mkstart.sh ROOT OUT

Writes the start image (initramfs) for the kernel in the folder ROOT, without starting a program of it: pi/init is its
first program, pi/modules the drivers. The same root gives the same bytes. Needs kmod, cpio, zstd.
END
}

[ $# = 2 ] || { usage >&2; exit 2; }
root=$1 out=$(realpath -m "$2")
here=$(cd "$(dirname "$0")" && pwd)
version=$(basename "$root"/usr/lib/modules/*)
work=$(mktemp -d "${TMPDIR:-/tmp}/bunraku-start.XXXXXX")
trap 'rm -rf "$work"' EXIT

start=$work/start
mkdir -p "$start"/{dev,proc,sys,run,root,usr/bin,scripts}
cp "$root/usr/bin/busybox" "$start/usr/bin/"
install -m 755 "$here/pi/init" "$start/init"
install -m 644 "$here/tree/etc/initramfs-tools/scripts/init-bottom/bunraku-overlay" "$start/over-the-root" # busybox would take a file `overlay` for the thing to mount
: >"$start/scripts/functions" # the overlay's script reads it; its panic() is in init

depmod -b "$root" "$version"
sed 's/#.*//' "$here/pi/modules" | tr -s ' \n' '\n' | sed '/^$/d' | while read -r module; do
    modprobe -d "$root" -S "$version" --show-depends "$module" 2>/dev/null ||
        echo "mkstart: this kernel has no driver $module." >&2
done | sed -n 's/^insmod \([^ ]*\).*/\1/p' | awk '!seen[$0]++' >"$work/files"
[ -s "$work/files" ] || { echo "mkstart: no driver was found in $root." >&2; exit 1; }
mkdir -p "$start/drivers"
while read -r file; do
    name=$(basename "${file%.xz}")
    case $file in *.xz) xz --decompress --stdout "$file" ;; *) cat "$file" ;; esac >"$start/drivers/$name"
    echo "/drivers/$name" >>"$start/modules"
done <"$work/files"

find "$start" -exec touch --no-dereference --date="@${SOURCE_DATE_EPOCH:-0}" {} +
(cd "$start" && find . -print0 | LC_ALL=C sort -z |
    cpio --null --create --format=newc --reproducible --owner=0:0 --quiet) | zstd -q -19 -T1 >"$out"
