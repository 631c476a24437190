#!/bin/bash
# Boots a box from a read-only root, in a mount namespace of its own: whatever it mounts is gone when it ends.
set -euo pipefail

usage() {
    cat <<'END'
usage: unshare --mount --propagation private nspawn.sh FOLDER NAME [--data IMAGE OPTIONS] [--stick IMAGE]
           [--memory BYTES] -- NSPAWN_OPTION...

Expects FOLDER/root. Mounts it read-only, the data disk and the stick below FOLDER/box and starts PID 1 over a
root whose changes stay in memory, in the control group NAME. Works where systemd runs and where it does not.
END
}

[ "${1:-}" != --help ] || { usage; exit 0; }
folder=${1:?$(usage)} name=${2:?$(usage)}
shift 2
data='' data_options='' stick='' memory=''
while [ "${1:-}" != -- ]; do
    case ${1:?$(usage)} in
        --data) data=$2 data_options=$3; shift 3 ;;
        --stick) stick=$2; shift 2 ;;
        --memory) memory=$2; shift 2 ;;
        *) usage >&2; exit 2 ;;
    esac
done
shift

# A limit of memory comes from whichever version of control groups has that controller.
if [ -n "$memory" ] && [ -d /sys/fs/cgroup/memory ]; then
    mkdir -p "/sys/fs/cgroup/memory/$name"
    echo "$memory" >"/sys/fs/cgroup/memory/$name/memory.limit_in_bytes"
    echo $$ >"/sys/fs/cgroup/memory/$name/cgroup.procs"
fi
if [ "$(stat --file-system --format %T /sys/fs/cgroup)" != cgroup2fs ]; then
    umount --lazy /sys/fs/cgroup
    mount -t cgroup2 cgroup2 /sys/fs/cgroup
fi
mkdir -p "/sys/fs/cgroup/$name"
if [ -n "$memory" ] && [ -e "/sys/fs/cgroup/$name/memory.max" ]; then
    echo "$memory" >"/sys/fs/cgroup/$name/memory.max"
fi
echo $$ >"/sys/fs/cgroup/$name/cgroup.procs"

mkdir -p "$folder/box"
mount -t tmpfs tmpfs "$folder/box"
mkdir "$folder/box/root" "$folder/box/data" "$folder/box/stick"
mount --bind "$folder/root" "$folder/box/root"
mount -o remount,ro,bind "$folder/box/root"
binds=()
if [ -n "$data" ]; then
    mount -o "loop,noatime,$data_options" "$data" "$folder/box/data"
    binds+=("--bind=$folder/box/data:/data")
fi
if [ -n "$stick" ]; then
    mount -o ro,loop "$stick" "$folder/box/stick"
    binds+=("--bind-ro=$folder/box/stick:/media/bunraku")
fi
export SYSTEMD_NSPAWN_UNIFIED_HIERARCHY=1
exec systemd-nspawn --quiet --register=no --keep-unit --boot --console=pipe --link-journal=no \
    --resolv-conf=off --timezone=off --directory="$folder/box/root" --volatile=overlay \
    --capability=CAP_NET_ADMIN,CAP_SYS_RESOURCE,CAP_IPC_LOCK --rlimit=RLIMIT_MEMLOCK=infinity \
    --rlimit=RLIMIT_RTPRIO=99 "${binds[@]}" "$@"
