# The box's target, for the scripts of this folder: Python, processors, and which wheels fit them. shellcheck
# shell=bash

PYTHON=3.13
# Debian 13 has glibc 2.41: every wheel for an older one fits.
GLIBC="2_17 2_27 2_28 2_34 2_35 2_39"

machine() {
    case $1 in
    amd64) echo x86_64 ;;
    arm64) echo aarch64 ;;
    *) echo "No box has the processor '$1'. Choose amd64 (NUC) or arm64 (Raspberry Pi)." >&2; return 2 ;;
    esac
}

# A separate environment in build/release, so that a release does not depend on the developer's.
prepare_tools() {
    tools=${checkout:?}/build/release/tools
    [ -x "$tools/bin/python" ] || python3 -m venv "$tools"
    "$tools/bin/python" -m pip install --quiet --disable-pip-version-check "$@" 2>/dev/null ||
        { echo "Could not install $* into $tools. Is there a network?" >&2; return 1; }
}

pip() { "${tools:?}/bin/python" -m pip --disable-pip-version-check "$@" 2> >(grep -v '^WARNING: Location' >&2); }

# $1 processor, $2 folder, then the packages for pip to fetch: only wheels, each by its name, no dependencies.
fetch_wheels() {
    local arch=$1 folder=$2 glibc platforms=()
    shift 2
    for glibc in $GLIBC; do platforms+=(--platform "manylinux_${glibc}_$(machine "$arch")"); done
    platforms+=(--platform "manylinux2014_$(machine "$arch")" --platform "linux_$(machine "$arch")")
    pip download --quiet --no-deps --only-binary=:all: --implementation cp --python-version "$PYTHON" \
        "${platforms[@]}" --dest "$folder" "$@"
}

# The public half of the key file $1, which may be either half.
public_half() { case $1 in *.pub) cat "$1" ;; *) ssh-keygen -y -f "$1" ;; esac | cut -d ' ' -f 1,2; }

# Where this machine's own packages with the label $1 (Debian, Debian-Security) come from.
# shellcheck disable=SC2016 # apt's own pattern
mirror() { apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' "Label: $1" | sort -u | head -n 1; }

# The box's Python, on this machine: its own where it has one, else Debian 13's beside this system.
target_python() {
    local folder=${checkout:?}/build/release/python-$PYTHON loader
    [ ! -x "/usr/bin/python$PYTHON" ] || { "/usr/bin/python$PYTHON" "$@"; return; }
    if [ ! -d "$folder" ]; then
        mmdebstrap --quiet --mode=chrootless --variant=extract --include="libpython$PYTHON-stdlib,python$PYTHON-minimal" \
            trixie "$folder.part" "deb $(mirror Debian) trixie main" >&2 ||
            { echo "Debian's Python $PYTHON did not come. Is mmdebstrap installed, and is there a network?" >&2; return 1; }
        mv "$folder.part" "$folder"
    fi
    loader=$(find "$folder/usr/lib" -name 'ld-linux-*.so.*' -not -type l | head -n 1)
    PYTHONHOME=$folder/usr "$loader" --library-path "$(dirname "$loader")" "$folder/usr/bin/python$PYTHON" "$@"
}
