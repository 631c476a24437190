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

# Fetches Debian 13's packages $3... for the processor $1 and unpacks them into $2, by an apt that knows nothing of this
# machine's packages.
fetch_debian() {
    local arch=$1 folder=$2 apt=$2.apt mirror package
    shift 2
    # shellcheck disable=SC2016 # apt's own pattern
    mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Label: Debian' | sort -u | head -n 1)
    [ -n "$mirror" ] || { echo "No Debian mirror among this machine's apt sources, for: $*" >&2; return 1; }
    rm -rf "$apt" "$folder"
    mkdir -p "$apt/state/lists/partial" "$apt/cache/archives/partial" "$folder"
    printf 'deb [arch=%s signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] %s trixie main\n' \
        "$arch" "$mirror" >"$apt/sources.list"
    touch "$apt/status"
    (
        cd "$apt"
        export APT_CONFIG=$apt/apt.conf
        printf '%s\n' "Dir::State \"$apt/state\";" "Dir::State::status \"$apt/status\";" "Dir::Cache \"$apt/cache\";" \
            "Dir::Etc::sourcelist \"$apt/sources.list\";" 'Dir::Etc::sourceparts "/dev/null";' \
            "APT::Architecture \"$arch\";" "APT::Architectures { \"$arch\"; };" 'APT::Sandbox::User "root";' \
            'Acquire::Languages "none";' >apt.conf
        apt-get -qq update && apt-get -qq download "$@"
    ) || { echo "$* for $arch did not come from Debian. Is there a network?" >&2; return 1; }
    for package in "$apt"/*.deb; do dpkg-deb --extract "$package" "$folder"; done
    rm -rf "$apt"
}

# The box's Python, on this machine: its own where it has one, else Debian 13's beside this system.
target_python() {
    local folder=${checkout:?}/build/release/python-$PYTHON loader
    [ ! -x "/usr/bin/python$PYTHON" ] || { "/usr/bin/python$PYTHON" "$@"; return; }
    [ -x "$folder/usr/bin/python$PYTHON" ] ||
        fetch_debian "$(dpkg --print-architecture)" "$folder" "python$PYTHON-minimal" "libpython$PYTHON-minimal" \
            "libpython$PYTHON-stdlib" libc6 zlib1g libexpat1
    loader=$(find "$folder" -name 'ld-linux-*.so.*' -not -type l | head -n 1)
    PYTHONHOME=$folder/usr "$loader" --library-path "$(dirname "$loader")" "$folder/usr/bin/python$PYTHON" "$@"
}
