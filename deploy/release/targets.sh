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

uv_platform() { echo "$(machine "$1")-unknown-linux-gnu"; }

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

# SHA256SUMS over all files of the release in folder $1.
write_sums() {
    (cd "$1" && find . -type f -not -name 'SHA256SUMS*' | LC_ALL=C sort | xargs -d '\n' sha256sum) >"$1.sums"
    mv "$1.sums" "$1/SHA256SUMS"
}
