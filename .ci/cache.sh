# shellcheck shell=bash disable=SC2154  # variables of .ci/run
# A cache of what takes long to make and does not depend on the checkout: the compiled dependencies, and the Python environment.
# Sourced by .ci/run.
#
# An entry is one tar file, KIND-KEY.tar, in ${TETREEL_CI_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/tetreel-ci}, with its checksum
# beside it. It is written to another name and renamed, so that a reader finds a whole entry or none, and checked when it is read: a
# damaged one is reported, removed and made anew. Whatever fails here costs time and nothing else.

cache=${TETREEL_CI_CACHE:-${XDG_CACHE_HOME:-${HOME:-/nonexistent}/.cache}/tetreel-ci}
# Entries of one kind that are kept: those of this change and of the one before it.
cache_kept=2

# cache_path KIND KEY: the file of an entry.
cache_path() {
    printf '%s/%s-%s.tar' "$cache" "$1" "$2"
}

# cache_restore KIND KEY FOLDER: unpacks an entry into a folder, or returns 1 and leaves none of it there.
cache_restore() {
    local entry fresh=$3.restored
    entry=$(cache_path "$1" "$2")
    if ! [ -r "$entry" ] || ! [ -r "$entry.sha256" ]; then
        echo "cache: no $1 of this key in $cache"
        return 1
    fi
    rm -rf "$fresh"
    mkdir -p "$fresh" "$3"
    # Whole before anything is unpacked; then hard links bring it into the folder, whatever that has already.
    if [ "$(sha256sum <"$entry" | cut -d ' ' -f 1)" != "$(cat "$entry.sha256")" ]; then
        echo "cache: $entry is damaged; it is not used, and made anew"
        rm -f "$entry" "$entry.sha256" 2>/dev/null || echo "cache: it could not be removed"
    elif tar -x -C "$fresh" -f "$entry" && cp -alf "$fresh/." "$3/"; then
        rm -rf "$fresh"
        touch "$entry" 2>/dev/null || true
        echo "cache: $1 from $entry"
        return 0
    else
        echo "cache: $entry could not be unpacked; it is not used"
    fi
    rm -rf "$fresh"
    return 1
}

# cache_save KIND KEY FOLDER TAR-ARGUMENT...: packs (parts of) a folder, unless the entry is there or another run is writing.
cache_save() {
    local kind=$1 key=$2 folder=$3 entry fresh
    shift 3
    entry=$(cache_path "$kind" "$key")
    if [ -e "$entry" ] && [ -e "$entry.sha256" ]; then
        return 0
    fi
    if ! mkdir -p "$cache" 2>/dev/null || ! : 2>/dev/null >>"$cache/lock"; then
        echo "cache: $cache cannot be written; $kind is not kept"
        return 0
    fi
    (
        # One writer at a time. The lock goes with the process that holds it.
        if command -v flock >/dev/null && ! flock -n 9; then
            echo "cache: another run is writing; $kind is not kept"
            exit 0
        fi
        # What a killed writer has left; no other is at work now.
        rm -f "$cache"/*.tmp
        fresh=$entry.tmp
        if tar -c -C "$folder" "$@" | tee "$fresh" | sha256sum | cut -d ' ' -f 1 >"$fresh.sum.tmp" && [ -s "$fresh" ]; then
            mv -f "$fresh.sum.tmp" "$entry.sha256"
            mv -f "$fresh" "$entry"
            echo "cache: kept $kind in $entry ($(du -h "$entry" | cut -f 1))"
        else
            rm -f "$fresh" "$fresh.sum.tmp"
            echo "cache: $kind could not be kept"
        fi
        # shellcheck disable=SC2012  # names of our own making
        ls -t "$cache/$kind"-*.tar 2>/dev/null | tail -n +$((cache_kept + 1)) | while read -r old; do
            rm -f "$old" "$old.sha256"
        done
    ) 9>>"$cache/lock"
}

# What compiled dependencies depend on: compiler, flags and target; then versions, profiles and features.
cache_key_of_dependencies() {
    {
        rustc -vV
        env | grep -E '^(RUSTFLAGS|CARGO_ENCODED_RUSTFLAGS|CARGO_BUILD_[A-Z_]*|CARGO_PROFILE_[A-Z_]*|CARGO_TARGET_[A-Z0-9_]*_(RUSTFLAGS|LINKER))=' | sort
    } | sha256sum | cut -c 1-12 | tr '\n' -
    {
        cat Cargo.lock
        for manifest in Cargo.toml tests/ui/Cargo.toml; do
            sed 's/[[:space:]]*#.*//' "$manifest" | awk '/^\[/ { kept = /^\[(profile|features|.*dependencies)/ } kept'
        done
    } | sha256sum | cut -c 1-12
}

# cache_restore_nearest KIND KEY FOLDER: the newest entry of the same compiler, flags and target. Cargo knows what of it can be used.
cache_restore_nearest() {
    local entry
    # shellcheck disable=SC2012  # names of our own making
    entry=$(ls -t "$cache/$1-${2%-*}"-*.tar 2>/dev/null | sed -n 1p)
    [ -n "$entry" ] || return 1
    entry=$(basename "$entry" .tar)
    cache_restore "$1" "${entry#"$1-"}" "$3"
}

# Keeps the compiled dependencies in $target: all that cargo made there but for the workspace's own packages. The hash in the name
# of a package's fingerprint is that in the names of what was compiled.
cache_save_dependencies() {
    local own profile
    own=$(mktemp)
    for profile in debug release; do
        find "$target/$profile/.fingerprint" -maxdepth 1 -name 'tetreel*' 2>/dev/null | sed 's/.*-\([0-9a-f]*\)$/*-\1*/'
    done >"$own"
    (cd "$target" && find {debug,release}/{.fingerprint,build,deps} -maxdepth 0 2>/dev/null) >"$own.folders" || true
    cache_save dependencies "$1" "$target" --exclude-from="$own" --exclude='*tetreel*' --files-from="$own.folders"
    rm -f "$own" "$own.folders"
}
