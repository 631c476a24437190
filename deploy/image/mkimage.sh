#!/bin/bash
# Makes the disk image of a box: starts by UEFI or BIOS, a root that is never written, a partition for what is kept.
set -euo pipefail

usage() {
    cat <<'END'
usage: mkimage.sh [--show FOLDER] [--box FILE] [--fast] ROOT OUT.img

Makes OUT.img from ROOT, a folder that mkroot.sh filled (with its kernel). Write it to the box's disk:
  dd if=OUT.img of=/dev/DISK bs=4M conv=fsync status=progress
At the first start its data partition takes the rest of the disk.

  --show FOLDER   a show bundle for the boot partition (bunraku/show); later by stick, or by mounting that partition
  --box FILE      a box file for the boot partition (bunraku/box.yaml)
  --fast          pack the root quickly and a little larger: for trials

Partitions: 1 BIOS loader; 2 boot (FAT: loader, kernel, folder bunraku/); 3 root (squashfs); 4 data (ext4).
Needs squashfs-tools, mtools, dosfstools, fdisk, e2fsprogs, grub-pc-bin, grub-efi-amd64-bin, grub-common.
END
}

fail() {
    printf 'mkimage: %s\n' "$*" >&2
    exit 1
}

show='' box='' packing=(-comp zstd -Xcompression-level 19) given=()
while [ $# -gt 0 ]; do
    case $1 in
        --show) show=${2:?--show needs a folder}; shift 2 ;;
        --box) box=${2:?--box needs a file}; shift 2 ;;
        --fast) packing=(-comp zstd -Xcompression-level 3); shift ;;
        --help | -h) usage; exit 0 ;;
        -*) fail "unknown option $1. See mkimage.sh --help." ;;
        *) given+=("$1"); shift ;;
    esac
done
[ "${#given[@]}" = 2 ] || { usage >&2; exit 2; }
root=${given[0]} out=${given[1]}
[ -d "$root/boot" ] || fail "$root is no root file system: it has no boot/. Fill it with mkroot.sh."
kernel=$(find "$root/boot" -name 'vmlinuz-*' | sort -V | tail -n 1)
start_image=$(find "$root/boot" -name 'initrd.img-*' | sort -V | tail -n 1)
if [ -z "$kernel" ] || [ -z "$start_image" ]; then
    fail "$root has no kernel. Build it without --without-kernel."
fi
[ -z "$show" ] || [ -f "$show/show.yaml" ] || fail "$show is no show bundle: it has no show.yaml."
[ -z "$box" ] || [ -f "$box" ] || fail "there is no box file $box."
for program in mksquashfs mcopy mkfs.vfat sfdisk mke2fs grub-mkimage; do
    command -v "$program" >/dev/null || fail "$program is missing. Install what mkimage.sh --help names."
done

work=$(mktemp -d "${TMPDIR:-/tmp}/bunraku-image.XXXXXX")
trap 'rm -rf "$work"' EXIT

MIB=1048576
BIOS_AT=1 BOOT_AT=2 BOOT_MIB=254 ROOT_AT=256 ROOT_MIB=512 DATA_AT=768 DATA_MIB=64  # in MiB from the disk's start
boot_volume=$(od -An -N4 -tx4 /dev/urandom | tr -d ' ')
root_uuid=$(cat /proc/sys/kernel/random/uuid)

# No word on the projector's screen; a fault ends in a new start; the machine keeps one identity. A disk that does
# not show up within 10 s is taken for absent.
COMMAND_LINE="root=PARTUUID=$root_uuid rootfstype=squashfs ro quiet loglevel=3 vt.global_cursor_default=0
    consoleblank=0 panic=5 systemd.machine_id=firmware systemd.gpt_auto=0 systemd.default_device_timeout_sec=10
    console=tty2 console=ttyS0,115200"

loader() {
    printf 'search --no-floppy --fs-uuid --set=root %s\nset prefix=(%s)/grub\n' \
        "${boot_volume:0:4}-${boot_volume:4}" "\$root" >"$work/find.cfg"
    printf 'set timeout=0\nlinux /linux %s\ninitrd /initrd\nboot\n' "$(tr -s ' \n' ' ' <<<"$COMMAND_LINE")" \
        >"$work/grub.cfg"
    local modules=(part_gpt fat normal linux search search_fs_uuid boot echo configfile)
    grub-mkimage -O x86_64-efi -p /grub -c "$work/find.cfg" -o "$work/BOOTX64.EFI" "${modules[@]}" efi_gop
    grub-mkimage -O i386-pc -p /grub -c "$work/find.cfg" -o "$work/core.img" "${modules[@]}" biosdisk
}

boot_partition() {
    truncate -s $((BOOT_MIB * MIB)) "$work/boot"
    mkfs.vfat -F 32 -n BOXBOOT -i "$boot_volume" "$work/boot" >/dev/null
    mmd -i "$work/boot" ::/EFI ::/EFI/BOOT ::/grub ::/bunraku
    mcopy -i "$work/boot" "$work/BOOTX64.EFI" ::/EFI/BOOT/
    mcopy -i "$work/boot" "$work/grub.cfg" ::/grub/
    mcopy -i "$work/boot" "$kernel" ::/linux
    mcopy -i "$work/boot" "$start_image" ::/initrd
    if [ -n "$show" ]; then mcopy -s -i "$work/boot" "$show" ::/bunraku/show; fi
    if [ -n "$box" ]; then mcopy -i "$work/boot" "$box" ::/bunraku/box.yaml; fi
}

root_partition() {
    mksquashfs "$root" "$work/root" "${packing[@]}" -noappend -quiet -no-progress -wildcards -e 'boot/*' \
        >/dev/null
    local size
    size=$(stat -c %s "$work/root")
    [ "$size" -le $((ROOT_MIB * MIB)) ] || fail "the packed root has $((size / MIB)) MiB: more than its partition."
    echo "root: $(du -sm --exclude="$root/boot" "$root" | cut -f 1) MB unpacked, $((size / 1000000)) MB packed"
}

data_partition() {
    truncate -s $((DATA_MIB * MIB)) "$work/data"
    mke2fs -q -t ext4 -L data -m 1 -E lazy_itable_init=0,lazy_journal_init=0 "$work/data"
}

# $1 number, $2 bytes, $3 file, $4 where: the number, little-endian, at that place of the file.
patch_number() {
    local bytes='' i
    for ((i = 0; i < $2; i++)); do bytes+=$(printf '\\x%02x' $((($1 >> (8 * i)) & 255))); done
    # shellcheck disable=SC2059  # the bytes are the format
    printf "$bytes" | dd of="$3" bs=1 seek="$4" conv=notrunc status=none
}

# BIOS: 440 bytes at the disk's start load the loader's first sector, which loads the others.
bios_loader() {
    local sector=$((BIOS_AT * MIB / 512)) boot=/usr/lib/grub/i386-pc/boot.img
    patch_number $((sector + 1)) 8 "$work/core.img" $((0x1f4))
    dd if="$work/core.img" of="$1" bs=512 seek="$sector" conv=notrunc status=none
    dd if="$boot" of="$1" bs=1 count=440 conv=notrunc status=none
    patch_number "$sector" 8 "$1" $((0x5c))
}

assemble() {
    local disk=$out.part
    rm -f "$disk"
    truncate -s $(((DATA_AT + DATA_MIB + 1) * MIB)) "$disk"
    sfdisk --quiet "$disk" <<END
label: gpt
start=${BIOS_AT}MiB, size=1MiB, type=21686148-6449-6E6F-744E-656564454649, name=bunraku-bios
start=${BOOT_AT}MiB, size=${BOOT_MIB}MiB, type=uefi, name=bunraku-boot
start=${ROOT_AT}MiB, size=${ROOT_MIB}MiB, type=4F68BCE3-E8CD-4DB1-96E7-FBCAF984B709, uuid=$root_uuid, name=bunraku-root
start=${DATA_AT}MiB, size=${DATA_MIB}MiB, type=linux, name=data
END
    bios_loader "$disk"
    dd if="$work/boot" of="$disk" bs=1M seek="$BOOT_AT" conv=notrunc,sparse status=none
    dd if="$work/root" of="$disk" bs=1M seek="$ROOT_AT" conv=notrunc,sparse status=none
    dd if="$work/data" of="$disk" bs=1M seek="$DATA_AT" conv=notrunc,sparse status=none
    mv "$disk" "$out"
}

mkdir -p "$(dirname "$out")"
loader
boot_partition
root_partition
data_partition
assemble
cp "$root/etc/bunraku-packages" "${out%.img}.packages"
echo "$out: $(du -m "$out" | cut -f 1) MB on this disk, $(($(stat -c %s "$out") / 1000000)) MB written out"
