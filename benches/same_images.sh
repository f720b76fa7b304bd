#!/usr/bin/env bash
# Renders 40 scenes with two builds of tetreel and compares the images bit by bit: for refactors that may change none.
#
#   benches/same_images.sh BEFORE AFTER [--gpu] [--keep DIR] [--prove]
#
#   BEFORE, AFTER   two `tetreel` binaries, best release builds: debug builds take minutes
#   --gpu           eight more scenes on the GPU in software (llvmpipe)
#   --keep DIR      leaves the images in DIR/before and DIR/after, a folder a scene
#   --prove         AFTER has every camera moved by 1e-6: ends well if each scene shows a difference
#
# Both builds write the series themselves (these are compared, too) and read their own. Compared are all channels, depth among
# them, as the files have them, compressed: equal bits make equal bytes, and a zero of the other sign others. (`tetreel compare`
# takes 0 and -0 for equal, and says nothing of depth that one of two files lacks; it only says how far images are apart.)
# Attributes, which hold versions and fingerprints, may differ. A frame in which nothing is seen is a fault of its scene, unless
# the scene is meant to be clear.
#
# Ends with 0 if everything is the same, 1 if something differs or a scene is clear, 2 if a build fails or an argument is wrong.
set -euo pipefail
export LC_ALL=C

usage() {
    echo "usage: ${0##*/} BEFORE AFTER [--gpu] [--keep DIR] [--prove]" >&2
    exit 2
}

gpu='' keep='' prove=''
builds=()
while [ $# -gt 0 ]; do
    case $1 in
    --gpu) gpu=1 ;;
    --prove) prove=1 ;;
    --keep)
        [ $# -gt 1 ] || usage
        keep=$2
        shift
        ;;
    -*) usage ;;
    *) builds+=("$1") ;;
    esac
    shift
done
[ ${#builds[@]} = 2 ] || usage
for build in "${builds[@]}"; do
    [ -f "$build" ] && [ -x "$build" ] || { echo "$build: no program" >&2 && exit 2; }
done
declare -A program
program[before]=$(realpath "${builds[0]}")
program[after]=$(realpath "${builds[1]}")
data=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../data")

work=$(realpath "$(mktemp -d "${TMPDIR:-/tmp}/same_images.XXXXXX")")
trap 'rm -rf "$work"' EXIT
images=$work/images
if [ -n "$keep" ]; then
    mkdir -p "$keep" || exit 2
    [ -z "$(ls -A "$keep")" ] || { echo "$keep: is not empty" >&2 && exit 2; }
    images=$(realpath "$keep")
fi

# run BUILD ARGUMENT...: the program in the current folder, with a cache of its own; what it says is in $work/log.
run() {
    local build=$1
    shift
    TETREEL_CACHE=$work/$build/cache "${program[$build]}" --quiet "$@" >"$work/log" 2>&1 </dev/null
}
# failure BUILD: says on one line that it failed, and why.
failure() {
    printf 'FAILED with the build %s: %s\n' "$1" "$(tr '\n' ' ' <"$work/log")"
}

# Series ------------------------------------------------------------------------------------------------------------------------

# make_series BUILD: in the current folder. Relative names, since a store names its source.
make_series() {
    run "$1" synth jet -o jet.zarr --cells 30000 --steps 8 &&
        run "$1" synth dipole -o dipole.zarr --cells 8000 --steps 8 &&
        run "$1" synth slab -o slab.zarr --cells 3000 --steps 4 &&
        run "$1" synth decay -o decay --cells 12000 --steps 4 &&
        run "$1" synth tornado -o tornado --cells 6000 --steps 16 &&
        run "$1" import tornado/tornado.pvd -o vq.zarr --codec vq --entries 64 &&
        write_tables
}

write_tables() {
    cat >extinction.json <<'END'
{
  "color_map": { "Name": "ink", "ColorSpace": "HSV", "RGBPoints": [0, 0, 0, 1, 0.4, 0.1, 0.9, 0.3, 1, 1, 0, 0] },
  "positions": "absolute", "values": "extinction",
  "points": [[0.05, 0], [0.3, 0.4], [0.3, 0.9], [0.7, 0.1], [1, 6]]
}
END
    cat >kept.toml <<'END'
version = 1
[data]
source = "jet.zarr"
field = "dye"
[[ensembles]]
name = "variation"
colors = "opacity"
[[ensembles.members]]
name = "haze"
function = { transfer-function = { color_map = "gray", points = [[0, 0.01], [1, 0.02]] } }
[[ensembles.members]]
name = "what changes"
blend = "add"
space = "cov"
reduction = "keep"
function = { transfer-function = { color_map = "inferno", points = [[0.8, 0], [0.95, 0.3]] } }
[[ensembles]]
name = "boundaries"
[[ensembles.members]]
name = "haze"
function = { transfer-function = { color_map = "viridis", points = [[0, 0.01], [1, 0.02]] } }
[[ensembles.members]]
name = "changes much"
space = "scalar-cov"
blend = "add"
reduction = "keep"
[[ensembles.members.function.widgets]]
rectangle = { x = [0.1, 0.9], y = [0.8, 1.0], rgb = [0.9, 0.2, 0.1], opacity = [0.02, 0.1] }
[[ensembles.members]]
name = "steep"
space = "scalar-gradient"
blend = "add"
reduction = "keep"
[[ensembles.members.function.widgets]]
triangle-with-fall-off = { base = [0.5, 0.0], top = 1.0, left = 0.0, right = 1.0, rgb = [0.2, 0.3, 0.9], opacity = 0.05 }
END
    sed 's/reduction = "keep"/reduction = "intensity"/' kept.toml >reduced.toml
    sed 's/^version.*/&\n[look]\nensemble = "boundaries"/' kept.toml >boundaries.toml
    # Between the two at every time but the first and the last one.
    { cat kept.toml && printf '[[timeline.ensembles]]\ntime = %s\nvalue = "%s"\n' 0.0 variation 24.0 boundaries; } >blended.toml
}

# Pixels ------------------------------------------------------------------------------------------------------------------------

# pixels FILE: what an EXR of one part says of its pixels, on a line each: the attributes that describe them, and the rows of each
# block with its compressed bytes.
pixels() {
    od -An -v -tu1 "$1" | awk '
        { for (i = 1; i <= NF; i++) byte[n++] = $i + 0 }
        function number(from, size,    i, sum) {
            for (i = size - 1; i >= 0; i--) sum = 256 * sum + byte[from + i]
            return sum
        }
        function text(    found) {
            while (byte[at]) found = found sprintf("%c", byte[at++])
            at++
            return found
        }
        function put(label, from, size,    i) {
            printf "%s:", label
            for (i = 0; i < size; i++) printf " %d", byte[from + i]
            print ""
        }
        END {
            at = 8
            while (byte[at]) {
                name = text(); text()
                size = number(at, 4)
                if (name ~ /^(channels|compression|dataWindow|lineOrder)$/) put(name, at + 4, size)
                at += 4 + size
            }
            # The table of blocks ends where the first block begins.
            at++
            for (end = number(at, 8); at < end; at += 8) {
                block = number(at, 8)
                put("row " number(block, 4), block + 8, number(block + 4, 4))
            }
        }'
}

# apart A B: max and rmse of colour, the same of depth, and the number of pixels of which only one image has a depth.
apart() {
    "${program[before]}" compare --json "$1" "$2" 2>>"$work/log" | tr -d ' "{}\n' |
        awk -F '[,:]' '{ for (i = 1; i < NF; i++) if ($i ~ /^(max|rmse|unmatched)$/) printf "%s ", $(i + 1) }'
}

# Largest differences on a GPU where the arithmetic of a shader was changed on purpose.
gpu_max=1e-5 gpu_rmse=1e-7

# difference A B: nothing if the pixels are the same, else how far they are apart and where.
difference() {
    local one=$work/one.txt other=$work/other.txt places numbers max rmse depth_max depth_rmse unmatched
    cmp -s "$1" "$2" && return
    pixels "$1" >"$one"
    pixels "$2" >"$other"
    if ! grep -q '^row ' "$one" || ! grep -q '^row ' "$other"; then
        echo "not both are EXR files"
        return
    fi
    cmp -s "$one" "$other" && return
    places=$({ diff "$one" "$other" || true; } | sed -n 's/^[<>] \([^:]*\):.*/\1/p' | sort -u -k 1,1 -k 2,2n)
    places=$(sed -n '1s/^/blocks: /; $!{1p;d}; 1!s/^/to /; p' <<<"$places" | tr '\n' ' ')
    if ! numbers=$(apart "$1" "$2") || [ -z "$numbers" ]; then
        echo "cannot be compared; ${places% }"
        return
    fi
    read -r max rmse depth_max depth_rmse unmatched <<<"$numbers"
    printf 'max %.3g rmse %.3g; depth ' "$max" "$rmse"
    if [ -n "$unmatched" ]; then
        printf 'max %.3g rmse %.3g, unmatched %d' "$depth_max" "$depth_rmse" "$unmatched"
    else
        printf 'in not both'
    fi
    printf '; %s' "${places% }"
    if awk "BEGIN { exit !($max == 0 && 0$depth_max == 0 && 0$unmatched == 0) }"; then printf ' (signs of zeros, or another compressor)'; fi
    if [ "${backend[1]}" = gpu ] && awk "BEGIN { exit !($max <= $gpu_max && $rmse <= $gpu_rmse) }"; then
        printf ' (within max %s rmse %s)' $gpu_max $gpu_rmse
    fi
}

# is_clear FILE SIZE: whether nothing is seen in it.
is_clear() {
    local clear=$work/clear_$2.exr numbers
    [ -e "$clear" ] || run before render "$work/before/slab.zarr" -o "$clear" --steps 0 --tf 'gray@0:0,1:0' --size "$2" \
        --exr raw --backend cpu || { failure before >&2 && exit 2; }
    numbers=$(apart "$1" "$clear") && [ -n "$numbers" ] || { echo "$1: cannot be compared with $clear" >&2 && exit 2; }
    awk "BEGIN { exit !(${numbers%% *} == 0) }"
}

# Scenes ------------------------------------------------------------------------------------------------------------------------

same=0 differ=0 faulty=0 failed=0
backend=(--backend cpu)
meant_to_be_clear=''

# camera_moved FILE: the camera that an EXR was made with, its x greater by 1e-6.
camera_moved() {
    local number='[-+0-9.e]*'
    grep -a -o "pos=$number,$number,$number focal=$number,$number,$number up=$number,$number,$number [a-z]*=$number near=$number" "$1" |
        awk 'NR == 1 { match($0, /^pos=[^,]*/); printf "pos=%.17g%s", substr($0, 5, RLENGTH - 4) + 1e-6, substr($0, RLENGTH + 1) }'
}

# render BUILD NAME SOURCE CAMERA OPTION...: frames of a scene. SOURCE is a series of the build or has its whole path; CAMERA - is
# that of the project, or one that shows all of the mesh.
render() {
    local build=$1 folder=$images/$1/$2 source=$3 camera=$4
    shift 4
    [[ $source = /* ]] || source=$work/$build/$source
    [ "$camera" = - ] || set -- "$@" --camera "$camera"
    mkdir -p "$folder"
    (cd "$folder" && run "$build" render "$source" -o '%04d.exr' --exr raw "${backend[@]}" "$@")
}

# judge NAME SIZE: `same`, or what differs in which frame.
judge() {
    local frame found
    local -a before=("$images/before/$1"/*.exr) after=("$images/after/$1"/*.exr)
    [ ${#before[@]} = ${#after[@]} ] || { echo "differs: ${#before[@]} frames and ${#after[@]}" && return; }
    for frame in "${before[@]##*/}"; do
        if is_clear "$images/before/$1/$frame" "$2"; then
            [ -n "$meant_to_be_clear" ] || { echo "FAULTY: nothing is seen in $frame" && return; }
        elif [ -n "$meant_to_be_clear" ]; then
            echo "FAULTY: $frame is meant to be clear, and is not" && return
        fi
        found=$(difference "$images/before/$1/$frame" "$images/after/$1/$frame")
        [ -z "$found" ] || { echo "differs in $frame: $found" && return; }
    done
    echo same
}

# scene NAME SOURCE SIZE CAMERA OPTION...
scene() {
    local name=$1 source=$2 size=$3 camera=$4 verdict
    shift 4
    set -- --size "$size" "$@"
    if ! render before "$name" "$source" "$camera" "$@"; then
        verdict=$(failure before)
    else
        [ -z "$prove" ] || camera=$(camera_moved "$images/before/$name/0000.exr")
        if ! render after "$name" "$source" "$camera" "$@"; then
            verdict=$(failure after)
        else
            verdict=$(judge "$name" "$size")
        fi
    fi
    count "$name" "$verdict"
}

count() {
    case $2 in
    same) same=$((same + 1)) ;;
    differs*) differ=$((differ + 1)) ;;
    FAILED*) failed=$((failed + 1)) ;;
    *) faulty=$((faulty + 1)) ;;
    esac
    printf '%-20s %s\n' "$1" "$2"
}

# clear_scene ...: a scene in which nothing is seen on purpose.
clear_scene() {
    meant_to_be_clear=1
    scene "$@"
    meant_to_be_clear=''
}

dense='viridis@0:0.05,1:0.5'
tents='viridis@0.1:0,0.2:0.6,0.3:0,0.45:0,0.5:0.5,0.55:0,0.7:0,0.8:0.9,0.9:0'
signed='cool-to-warm@0:0.4,0.4:0,0.6:0,1:0.4'
beside='pos=4,-14,3 focal=4,0,0 up=0,0,1 angle=30'
inside='pos=3,0.2,0.1 focal=8,0.5,0 up=0,0,1 angle=60'
parallel='pos=4,-14,3 focal=4,0,0 up=0,0,1 parallel=3'

cpu_scenes() {
    # The ray caster: tables.
    scene first-look jet.zarr 256x192 - --steps 5
    scene dense jet.zarr 256x192 "$beside" --steps 5 --mode raycast --tf "$dense"
    scene haze jet.zarr 97x61 "$beside" --steps 5 --mode raycast --tf 'gray@0:0.01,1:0.01'
    scene tents jet.zarr 256x192 "$beside" --steps 7 --tf "$tents"
    scene opaque jet.zarr 97x61 "$beside" --steps 5 --tf 'turbo@0:1,1:1'
    scene opaque-half jet.zarr 97x61 "$beside" --steps 6 --tf 'turbo@0:0,0.5:0,0.5:1,1:1'
    scene half-opaque-step jet.zarr 97x61 "$beside" --steps 6 --tf 'plasma_r@0:0,0.3:0,0.3:0.5,1:0.5'
    scene extinction jet.zarr 97x61 "$beside" --steps 4 --tf 'inferno@0:0,1:4' --opacity-kind extinction
    scene file jet.zarr 97x61 "$beside" --steps 4 --tf "$work/before/extinction.json"
    scene signed dipole.zarr 97x61 - --steps 3 --tf "$signed" --range symmetric
    scene logarithmic dipole.zarr 64x64 - --steps 1 --tf "$dense" --range log
    # The ray caster: cameras and sizes.
    scene inside jet.zarr 256x192 "$inside" --steps 5 --tf "$dense"
    scene parallel jet.zarr 97x61 "$parallel" --steps 5 --tf "$tents"
    scene grazing jet.zarr 97x61 'pos=-8,-2.05,0 focal=8,-1.95,0 up=0,0,1 angle=20' --steps 5 --tf "$dense"
    scene along-an-axis slab.zarr 64x64 'pos=0,0,5 focal=0,0,0 up=0,1,0 parallel=1.2' --field linear --steps 2 --tf "$dense"
    scene near jet.zarr 97x61 "$beside near=13.8" --steps 5 --tf "$dense"
    scene one-pixel jet.zarr 1x1 "$beside" --steps 5 --tf "$dense"
    # The ray caster: what is left out, times, other optics.
    scene skip-none jet.zarr 97x61 "$beside" --steps 7 --tf "$tents" --skip none
    scene skip-some decay/decay.pvd 97x61 - --steps 1 --tf "$tents" --skip all,-clear-cells,-outside
    scene between jet.zarr 97x61 "$beside" --times 8..17 --duration 0.3 --fps 10 --interpolate --tf "$dense"
    scene turntable jet.zarr 64x64 "$beside" --steps 5 --duration 0.3 --fps 10 --turntable 90 --tf "$tents"
    scene table3d jet.zarr 97x61 "$beside" --steps 5 --optics table3d --tf "$dense"
    scene partial jet.zarr 256x192 "$inside" --steps 5 --optics partial --tf "$tents"
    # Faces.
    scene faces jet.zarr 256x192 "$beside" --steps 5 --mode havs --k 8 --tf "$dense"
    scene faces-30 jet.zarr 256x192 "$beside" --steps 6 --mode havs --lod 0.3 --tf "$dense"
    scene faces-inexact jet.zarr 97x61 "$inside" --steps 5 --mode havs --k 2 --inexact-order --tf "$dense"
    scene faces-k2 decay/decay.pvd 97x61 - --steps 1 --mode havs --k 2 --tf "$tents"
    scene faces-partial dipole.zarr 97x61 - --steps 2 --mode havs --optics partial --tf "$signed" --range symmetric
    scene faces-table3d jet.zarr 64x64 "$parallel" --steps 3 --mode havs --optics table3d --tf "$tents" --skip none
    scene auto-half jet.zarr 97x61 "$beside" --steps 5 --mode auto --lod 0.5 --sampling regular:4 --tf "$dense"
    scene vq vq.zarr 97x61 - --field velocity:mag --steps 9 --tf "$tents"
    scene vq-faces-40 vq.zarr 97x61 - --times 10..30 --duration 0.3 --fps 10 --interpolate --mode havs --lod 0.4 --sampling random
    # The judge.
    scene reference jet.zarr 64x64 "$inside" --steps 5 --mode reference --tf "$dense"
    scene reference-signed dipole.zarr 97x61 - --steps 3 --mode reference --tf "$signed" --range symmetric
    # Projects: ensembles, curves and tables over more than the scalar, timelines.
    scene kept-variation kept.toml 97x61 "$beside" --steps 5
    scene kept-faces boundaries.toml 97x61 "$inside" --steps 6 --mode havs
    scene kept-blended blended.toml 64x64 "$beside" --times 6..18 --duration 0.3 --fps 10 --interpolate
    scene reduced reduced.toml 97x61 "$beside" --steps 5
    scene sample-project "$data/projects/tornado.toml" 97x61 - --duration 0.4 --fps 10
    clear_scene nothing jet.zarr 64x64 'pos=4,-14,3 focal=4,-30,3 up=0,0,1 angle=30' --steps 5 --tf "$dense"
}

gpu_scenes() {
    backend=(--backend gpu --adapter llvmpipe)
    scene gpu-dense jet.zarr 97x61 "$beside" --steps 5 --mode raycast --tf "$dense"
    scene gpu-tents-inside jet.zarr 97x61 "$inside" --steps 5 --mode raycast --tf "$tents"
    scene gpu-opaque jet.zarr 97x61 "$parallel" --steps 6 --tf 'turbo@0:0,0.5:0,0.5:1,1:1'
    scene gpu-partial dipole.zarr 64x64 - --steps 3 --optics partial --tf "$signed" --range symmetric
    scene gpu-table3d jet.zarr 64x64 "$beside" --steps 3 --optics table3d --tf "$dense"
    scene gpu-faces jet.zarr 97x61 "$beside" --steps 5 --mode havs --tf "$tents"
    scene gpu-faces-30 vq.zarr 97x61 - --times 10..30 --duration 0.3 --fps 10 --interpolate --mode havs --lod 0.3 --tf "$dense"
    scene gpu-kept boundaries.toml 64x64 "$beside" --steps 5
}

# That one bit of a file counts, and attributes do not. The scene `dense` has been rendered.
prove_comparison() {
    local one=$images/before/dense/0000.exr other=$work/other.exr last found
    last=$(tail -c 1 "$one" | od -An -tu1)
    { head -c "-1" "$one" && printf '%b' "\\0$(printf '%o' $((last ^ 1)))"; } >"$other"
    found=$(difference "$one" "$other")
    count one-bit "${found:+differs: }${found:-same}"
    sed 's/tetreel.camera/tetreel.kamera/' "$one" >"$other"
    if cmp -s "$one" "$other" || [ -n "$(difference "$one" "$other")" ]; then
        count attributes 'FAULTY: attributes count as pixels, or none was changed'
    fi
}

for build in before after; do
    mkdir -p "$work/$build"
    (cd "$work/$build" && make_series "$build") || { failure "$build" && exit 2; }
done
# But for the program's version in a store.
if diff -r -q -I '"tetreel": ' "$work/before" "$work/after" >"$work/log"; then
    printf '%-20s same\n' series
else
    count series "differs: $(head -n 1 "$work/log")"
fi
cpu_scenes
[ -z "$gpu" ] || gpu_scenes
[ -z "$prove" ] || prove_comparison

echo "$((same + differ + faulty + failed)) scenes: $same same, $differ differ, $faulty faulty, $failed failed"
[ $failed = 0 ] || exit 2
[ $faulty = 0 ] || exit 1
if [ -n "$prove" ]; then
    # The one that is clear looks the same from everywhere.
    [ $same = 1 ] || { echo "of $((same - 1)) scenes the change is not seen" && exit 1; }
    echo "every scene shows the change"
else
    [ $differ = 0 ] || exit 1
fi
