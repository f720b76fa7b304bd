# shellcheck shell=bash disable=SC2154  # variables of .ci/run
# How tests are run, listed and timed. Sourced by .ci/run.

# Every test says how long it took: cargo starts test binaries through .ci/timed.
host=$(rustc -vV | sed -n 's/^host: //p')
host=${host^^}
export "CARGO_TARGET_${host//[-.]/_}_RUNNER=$PWD/.ci/timed"

# Tests that take longer say why in a comment.
long_seconds=5

# Temporary files of tests: in memory where there is room, since stores are flushed to the disk before they are renamed, which is what
# half of the tests of stores wait for.
temporary_files_in_memory() {
    local free
    free=$(df -Pk /dev/shm 2>/dev/null | awk 'NR == 2 { print $4 }')
    if [ -w /dev/shm ] && [ "${free:-0}" -gt $((4 << 20)) ]; then
        memory=$(mktemp -d /dev/shm/tetreel-ci.XXXXXX)
        export TMPDIR=$memory
    fi
}

# run_tests COMMAND...: runs tests, fails if it ran none, and lists those that took long. What they print is kept in tests.log.
run_tests() {
    local log=$scratch/tests.log passed
    "$@" 2>&1 | tee "$log"
    passed=$(sed -n 's/^test result: .* \([0-9]*\) passed;.*/\1/p' "$log" | awk '{ n += $1 } END { print n + 0 }')
    if [ "$passed" = 0 ]; then
        echo "no test ran: $*" >&2
        return 1
    fi
    echo "$passed tests passed; seconds of those that took over $long_seconds:"
    sed -n 's/^test \([^ ]*\) .*<\([0-9.]*\)s>$/\2 \1/p' "$log" | awk -v long=$long_seconds '$1 > long' | sort -rn
}

# Runs the tests again that `cargo test` had to skip, if only for a part: no other test would do anything else now.
tests_that_were_skipped() {
    local names unknown
    names=$(sed -n 's/.*SKIPPED \([A-Za-z0-9_:]*\): no .*/\1/p' "$scratch/tests.log" | sort -u)
    [ -n "$names" ] || { echo "nothing was skipped" && return; }
    cargo test --quiet --lib --test it -- --list | sed -n 's/: test$//p' | sort -u >"$scratch/tests.list"
    unknown=$(comm -23 <(printf '%s\n' "$names") "$scratch/tests.list")
    [ -z "$unknown" ] || { printf 'skipped, but no names of tests: %s\n' "$unknown" >&2 && return 1; }
    # shellcheck disable=SC2086  # names of tests, one word each
    run_tests cargo test --lib --test it -- --exact $names
}

# The test that takes gigabytes, where they are free.
ten_million_points() {
    local free
    free=$(sed -n 's/^MemAvailable: *\([0-9]*\) kB$/\1/p' /proc/meminfo)
    if [ "$free" -lt 6000000 ]; then
        echo "SKIPPED cloud::ten_million_points_add_up: $free kB of memory are free, of 6000000"
        return
    fi
    run_tests cargo test --test it -- --ignored --exact cloud::ten_million_points_add_up
}

# Shows that a test ends at a message of the validation layer: at the one that says that it is there, which counts in tests no more than
# other information does.
validation_messages_fail() {
    local settings=$scratch/validation.txt log=$scratch/validation.log
    sed 's/^\(khronos_validation.report_flags\) .*/\1 = info/' .ci/validation.txt >"$settings"
    if VK_LAYER_SETTINGS_PATH=$settings cargo test --lib gpu::raycast::stage_tests::transform >"$log" 2>&1; then
        echo "the validation layer says nothing, or nobody listens: $log" >&2
        return 1
    fi
    grep 'Khronos Validation Layer Active' "$log"
    grep 'SIGTRAP' "$log"
}

# The command without window and GPU.
headless=(--package tetreel --no-default-features --features cli)

# Of the build without window and GPU, the tests that differ: those that only it has, and those of the command line. Few of them compute for
# long: the crate is optimised less, which takes three fifths of the time.
tests_without_a_window() {
    local only less=(--config profile.dev.package.tetreel.opt-level=1)
    cargo test --quiet --test it -- --list | sed -n 's/: test$//p' | sort -u >"$scratch/it.list"
    cargo test --quiet "${less[@]}" "${headless[@]}" --test it -- --list | sed -n 's/: test$//p' | sort -u >"$scratch/bare.list"
    only=$(comm -13 "$scratch/it.list" "$scratch/bare.list")
    [ -n "$only" ] || { echo "the build without a window has no test of its own" >&2 && return 1; }
    # shellcheck disable=SC2086  # names of tests, one word each
    run_tests cargo test "${less[@]}" "${headless[@]}" --test it -- cli:: $only
}

# A program that is no member of the workspace builds on the library alone, which has no more than 120 crates and none of a command or a
# window, and renders a frame with it.
library_from_outside() {
    local crates
    crates=$(cargo tree --package tetreel --no-default-features --edges normal --prefix none | awk '{ print $1, $2 }' | sort -u)
    if grep -E '^(clap|indicatif|ctrlc|tracing-chrome|plotters|winit|egui)' <<<"$crates"; then return 1; fi
    echo "$(wc -l <<<"$crates") crates"
    [ "$(wc -l <<<"$crates")" -le 120 ]
    cargo build --manifest-path tests/library/Cargo.toml --target-dir "$target"
    picture "$target/debug/uses-tetreel" "$scratch/jet.zarr" "$scratch/library.png"
}

# The tests of the SIMD loops under valgrind. The library itself has no unsafe code (a test reads it); what it asks the processor
# for through pulp is looked at here, as compiled for AVX2: valgrind 3.19 knows no AVX-512, and hides it from the program.
simd_under_valgrind() {
    local library
    # What is built already; --no-run names it.
    library=$(cargo test --lib --test it --no-run 2>&1 | sed -n 's/.*unittests src\/lib.rs (\(.*\/tetreel-[0-9a-f]*\))$/\1/p')
    # One thread: valgrind runs one at a time anyway.
    RAYON_NUM_THREADS=1 valgrind --quiet --error-exitcode=9 "$library" --test-threads 1 \
        codec::vq::block:: codec::vq::pca:: cpu::lanes:: raycast::starts::tests::the_comparison
}

# The tests of the window, named one by one: with --package all that they are built on would be built again, with the features that
# this package alone asks for.
window_tests() {
    local tests=() file
    for file in tests/ui/tests/*.rs; do
        tests+=(--test "$(basename "$file" .rs)")
    done
    cargo test "${tests[@]}"
}

# For one Vulkan driver at a time there is no need of the window.
for_drivers=(--package tetreel --no-default-features --features cli,gpu)

# on_driver NAME FILE: what a Vulkan driver makes of the shaders: how long each takes to compile, the tests of the stages, and a frame of
# each renderer against that of the CPU.
on_driver() {
    local frames=$scratch/drivers mode
    export VK_DRIVER_FILES=$2
    timeout 3600 cargo test "${for_drivers[@]}" --lib -- --nocapture every_stage_compiles
    TETREEL_REQUIRE=gpu run_tests timeout 1800 cargo test "${for_drivers[@]}" --lib gpu:: -- --skip every_stage_compiles
    rm -rf "$frames"
    mkdir "$frames"
    tetreel synth jet --cells 20000 --steps 2 -o "$frames/jet.zarr"
    for mode in raycast havs; do
        tetreel render "$frames/jet.zarr" --steps 1 --size 256x256 --mode $mode --backend cpu -o "$frames/cpu.exr"
        timeout 600 "$target/debug/tetreel" render "$frames/jet.zarr" --steps 1 --size 256x256 --mode $mode --backend gpu -o "$frames/gpu.exr"
        echo "$mode, $1 and the CPU:"
        # Both are within these bounds of the reference (docs/limitations.md).
        tetreel compare "$frames/gpu.exr" "$frames/cpu.exr" --fail-above 1e-3
    done
}
tetreel() {
    "$target/debug/tetreel" "$@"
}
