#!/bin/bash
# Makes the disk image of a box (a PC's disk, a Raspberry Pi's card): a root that is never written, a partition for what
# is kept. The same root gives the same bytes.
set -euo pipefail

usage() {
    cat <<'END'
usage: mkimage.sh [--show FOLDER] [--box FILE] ROOT OUT.img

Makes OUT.img from ROOT, a folder that mkroot.sh filled (with its kernel). Write it to the box's disk:
  dd if=OUT.img of=/dev/DISK bs=4M conv=fsync status=progress
At the first start its data partition takes the rest of the disk.

  --show FOLDER   a show bundle for the boot partition (bunraku/show); later by stick, or by mounting that partition
  --box FILE      a box file for the boot partition (bunraku/box.yaml)

A PC starts by UEFI or BIOS. Partitions: 1 BIOS loader; 2 boot (FAT: loader, kernel, folder bunraku/); 3 root (squashfs);
4 data (ext4). A Raspberry Pi has no partition for a BIOS, and an older table of partitions beside the newer one, which
its loader may not know.
Needs squashfs-tools, mtools, dosfstools, fdisk, e2fsprogs; for a PC grub-pc-bin, grub-efi-amd64-bin, grub-common; for a
Pi what mkstart.sh needs. SOURCE_DATE_EPOCH: the time that all files get; left out, the last commit's.
END
}

fail() {
    printf 'mkimage: %s\n' "$*" >&2
    exit 1
}

show='' box='' given=()
while [ $# -gt 0 ]; do
    case $1 in
        --show) show=${2:?--show needs a folder}; shift 2 ;;
        --box) box=${2:?--box needs a file}; shift 2 ;;
        --help | -h) usage; exit 0 ;;
        -*) fail "unknown option $1. See mkimage.sh --help." ;;
        *) given+=("$1"); shift ;;
    esac
done
[ "${#given[@]}" = 2 ] || { usage >&2; exit 2; }
root=${given[0]} out=${given[1]}
[ -d "$root/boot" ] || fail "$root is no root file system: it has no boot/. Fill it with mkroot.sh."
here=$(cd "$(dirname "$0")" && pwd)
firmware=$root/usr/lib/raspi-firmware
if [ -d "$firmware" ]; then machine=pi; else machine=pc; fi
kernel=$(find "$root/boot" "$root/usr/lib/modules" -maxdepth 2 -name 'vmlinuz*' | sort -V | tail -n 1)
start_image=$(find "$root/boot" -name 'initrd.img-*' | sort -V | tail -n 1)
if [ -z "$kernel" ] || { [ $machine = pc ] && [ -z "$start_image" ]; }; then
    fail "$root has no kernel. Build it without --without-kernel."
fi
[ -z "$show" ] || [ -f "$show/show.yaml" ] || fail "$show is no show bundle: it has no show.yaml."
[ -z "$box" ] || [ -f "$box" ] || fail "there is no box file $box."
[ $machine = pi ] || command -v grub-mkimage >/dev/null || fail "grub-mkimage is missing: mkimage.sh --help names it."
for program in mksquashfs mcopy mkfs.vfat sfdisk mke2fs; do
    command -v "$program" >/dev/null || fail "$program is missing. Install what mkimage.sh --help names."
done

work=$(mktemp -d "${TMPDIR:-/tmp}/bunraku-image.XXXXXX")
trap 'rm -rf "$work"' EXIT

MIB=1048576
BIOS_AT=1 BOOT_AT=2 BOOT_MIB=254 ROOT_AT=256 ROOT_MIB=512 DATA_AT=768 DATA_MIB=64  # in MiB from the disk's start
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$here" log -1 --format=%ct 2>/dev/null || date +%s)}
export SOURCE_DATE_EPOCH LC_ALL=C TZ=UTC E2FSPROGS_FAKE_TIME=$SOURCE_DATE_EPOCH MTOOLS_SKIP_CHECK=1

# Names that are the same for the same release: what a partition holds follows from it.
release=$(cat "$root"/opt/bunraku/current/release 2>/dev/null || echo none)
named() { sha256sum <<<"$machine $release $1" | sed -E 's/^(.{8})(.{4}).(.{3}).(.{3})(.{12}).*/\1-\2-4\3-8\4-\5/'; }
boot_volume=$(named boot | cut -c 1-8)
root_uuid=$(named root)

# No word on the projector's screen; a fault ends in a new start; the machine keeps one identity. A disk that does
# not show up within 10 s is taken for absent.
COMMAND_LINE="root=PARTUUID=$root_uuid rootfstype=squashfs ro quiet loglevel=3 vt.global_cursor_default=0
    consoleblank=0 panic=5 systemd.machine_id=firmware systemd.gpt_auto=0 systemd.default_device_timeout_sec=10
    console=tty2 "
case $machine in
    pc) COMMAND_LINE+="console=ttyS0,115200" ;;
    # The serial console of a Pi 4 and of a Pi 5. A processor that always runs at its full pace has steady ticks.
    pi) COMMAND_LINE+="console=ttyS1,115200 console=ttyAMA10,115200 cpufreq.default_governor=performance" ;;
esac
command_line() { tr -s ' \n' ' ' <<<"$COMMAND_LINE" | sed 's/ $//'; }

loader() {
    printf 'search --no-floppy --fs-uuid --set=root %s\nset prefix=(%s)/grub\n' \
        "${boot_volume:0:4}-${boot_volume:4}" "\$root" >"$work/find.cfg"
    printf 'set timeout=0\nlinux /linux %s\ninitrd /initrd\nboot\n' "$(command_line)" \
        >"$work/grub.cfg"
    local modules=(part_gpt fat normal linux search search_fs_uuid boot echo configfile)
    grub-mkimage -O x86_64-efi -p /grub -c "$work/find.cfg" -o "$work/BOOTX64.EFI" "${modules[@]}" efi_gop
    grub-mkimage -O i386-pc -p /grub -c "$work/find.cfg" -o "$work/core.img" "${modules[@]}" biosdisk
}

boot_of_pc() {
    loader
    mkdir -p "$1/EFI/BOOT" "$1/grub"
    cp "$work/BOOTX64.EFI" "$1/EFI/BOOT/"
    cp "$work/grub.cfg" "$1/grub/"
    cp "$start_image" "$1/initrd"
}

# The loader of a Pi takes the device tree by these names; a newer Pi 5 asks for the second or the third.
boot_of_pi() {
    cp "$firmware"/{start4.elf,fixup4.dat} "$1/"
    cp "$root"/usr/lib/modules/*/dtb/broadcom/bcm27*.dtb "$1/"
    cp "$1/bcm2712-d-rpi-5-b.dtb" "$1/bcm2712d0-rpi-5-b.dtb"
    cp "$here/pi/config.txt" "$here/bunraku-wifi.yaml" "$1/"
    command_line >"$1/cmdline.txt"
    "$here/mkstart.sh" "$root" "$1/initrd"
}

boot_partition() {
    local boot=$work/boot-files
    mkdir -p "$boot/bunraku"
    boot_of_$machine "$boot"
    cp "$kernel" "$boot/linux"
    if [ -n "$show" ]; then cp -r "$show" "$boot/bunraku/show"; fi
    if [ -n "$box" ]; then cp "$box" "$boot/bunraku/box.yaml"; fi
    find "$boot" -exec touch --date="@$SOURCE_DATE_EPOCH" {} +
    truncate -s $((BOOT_MIB * MIB)) "$work/boot"
    mkfs.vfat --invariant -F 32 -n BOXBOOT -i "$boot_volume" "$work/boot" >/dev/null
    (cd "$boot" && find . -mindepth 1 -maxdepth 1 -printf '%f\n' | sort | while read -r file; do
        mcopy -s -m -i "$work/boot" "$file" ::/
    done)
}

root_partition() {
    # Level 19 makes it a fifth smaller, and takes twenty times as long.
    env -u SOURCE_DATE_EPOCH mksquashfs "$root" "$work/root" -comp zstd -Xcompression-level 9 -noappend -quiet \
        -no-progress -mkfs-time "$SOURCE_DATE_EPOCH" -all-time "$SOURCE_DATE_EPOCH" -wildcards \
        -e 'boot/*' 'usr/lib/modules/*/vmlinuz' 'usr/lib/raspi-firmware/*' >/dev/null
    local size
    size=$(stat -c %s "$work/root")
    [ "$size" -le $((ROOT_MIB * MIB)) ] || fail "the packed root has $((size / MIB)) MiB: more than its partition."
    echo "root: $(du -sm --exclude="$root/boot" "$root" | cut -f 1) MB unpacked, $((size / 1000000)) MB packed"
}

data_partition() {
    truncate -s $((DATA_MIB * MIB)) "$work/data"
    mke2fs -q -t ext4 -L data -m 1 -U "$(named data)" \
        -E "lazy_itable_init=0,lazy_journal_init=0,hash_seed=$(named hash)" "$work/data"
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

# An older table of partitions in the first sector: the boot partition for a loader that knows no other, and all else as
# taken by the newer table.
hybrid_table() {
    local at=446
    patch_number $((0x0c << 32)) 8 "$1" $at
    patch_number $((BOOT_AT * MIB / 512)) 4 "$1" $((at + 8))
    patch_number $((BOOT_MIB * MIB / 512)) 4 "$1" $((at + 12))
    patch_number $((0xee << 32)) 8 "$1" $((at + 16))
    patch_number 1 4 "$1" $((at + 24))
    patch_number $((BOOT_AT * MIB / 512 - 1)) 4 "$1" $((at + 28))
}

assemble() {
    local disk=$out.part bios='' kind=4F68BCE3-E8CD-4DB1-96E7-FBCAF984B709
    rm -f "$disk"
    truncate -s $(((DATA_AT + DATA_MIB + 1) * MIB)) "$disk"
    case $machine in
        pc) bios="start=${BIOS_AT}MiB, size=1MiB, type=21686148-6449-6E6F-744E-656564454649, uuid=$(named bios), name=bunraku-bios" ;;
        pi) kind=B921B045-1DF0-41C3-AF44-4C6F280D3FAE ;;
    esac
    sfdisk --quiet "$disk" <<END
label: gpt
label-id: $(named disk)
$bios
start=${BOOT_AT}MiB, size=${BOOT_MIB}MiB, type=uefi, uuid=$(named boot), name=bunraku-boot
start=${ROOT_AT}MiB, size=${ROOT_MIB}MiB, type=$kind, uuid=$root_uuid, name=bunraku-root
start=${DATA_AT}MiB, size=${DATA_MIB}MiB, type=linux, uuid=$(named data-partition), name=data
END
    case $machine in pc) bios_loader "$disk" ;; pi) hybrid_table "$disk" ;; esac
    dd if="$work/boot" of="$disk" bs=1M seek="$BOOT_AT" conv=notrunc,sparse status=none
    dd if="$work/root" of="$disk" bs=1M seek="$ROOT_AT" conv=notrunc,sparse status=none
    dd if="$work/data" of="$disk" bs=1M seek="$DATA_AT" conv=notrunc,sparse status=none
    mv "$disk" "$out"
}

mkdir -p "$(dirname "$out")"
boot_partition
root_partition
data_partition
assemble
cp "$root/etc/bunraku-packages" "${out%.img}.packages"
echo "$out: $(du -m "$out" | cut -f 1) MB on this disk, $(($(stat -c %s "$out") / 1000000)) MB written out"
