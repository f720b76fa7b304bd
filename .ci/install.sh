# shellcheck shell=bash disable=SC2154  # variables of .ci/run
# What the checks need beyond Rust. Sourced by .ci/run. Each function installs what is missing, or fails and says what to install.

apt_install() {
    if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
        echo "missing: $*; install them, or run as root where there is apt-get" >&2
        return 1
    fi
    apt-get update -qq
    apt-get install -qq -y --no-install-recommends "$@"
}

# A virtual environment with what the scripts in tests/interop import; kept until the list or Python changes.
python_packages='numpy==2.* zarr==3.* vtk==9.* OpenEXR==3.*'
python_versions() {
    "$1" -c 'import numpy, OpenEXR, vtk, zarr; print("numpy", numpy.__version__, "OpenEXR", OpenEXR.__version__, "vtk", vtk.VTK_VERSION, "zarr", zarr.__version__)'
}
set_up_python() {
    local venv=$scratch/python key
    command -v python3 >/dev/null || apt_install python3 python3-venv
    key=$({ command -v python3; python3 -VV; echo "$python_packages"; } | sha256sum | cut -c 1-16)
    if [ "$(cat "$venv/key" 2>/dev/null)" != "$key" ]; then
        rm -rf "$venv"
        [ -z "$use_cache" ] || cache_restore python "$key" "$venv" || true
        # The wheel of VTK takes these from the system.
        [ ! -e "$venv/key" ] || python_versions "$venv/bin/python3" >/dev/null 2>&1 || apt_install libgl1 libxrender1 libx11-6
    fi
    if [ "$(cat "$venv/key" 2>/dev/null)" != "$key" ] || ! python_versions "$venv/bin/python3" >/dev/null; then
        rm -rf "$venv"
        if ! python3 -m venv "$venv"; then
            rm -rf "$venv"
            apt_install python3 python3-venv
            python3 -m venv "$venv"
        fi
        # shellcheck disable=SC2086  # a list
        "$venv/bin/pip" install --quiet --disable-pip-version-check $python_packages
        "$venv/bin/python3" -c 'import vtk' 2>/dev/null || apt_install libgl1 libxrender1 libx11-6
        echo "$key" >"$venv/key"
        [ -z "$use_cache" ] || cache_save python "$key" "$venv" .
    fi
    python_versions "$venv/bin/python3"
    export PATH=$venv/bin:$PATH PYTHON=$venv/bin/python3
}

set_up_ffmpeg() {
    if ! command -v ffmpeg >/dev/null || ! command -v ffprobe >/dev/null; then apt_install ffmpeg; fi
}

set_up_valgrind() {
    command -v valgrind >/dev/null || apt_install valgrind
    valgrind --version
}

# A screen in memory for the window.
has_screen() {
    command -v Xvfb >/dev/null
}
set_up_screen() {
    has_screen || apt_install xvfb
}

# Mesa's Vulkan driver in software: a GPU for the tests, whatever the machine.
has_gpu() {
    # Nobody ends a pipe before its last line: that would be a failure.
    find /usr/share/vulkan /etc/vulkan -name 'lvp_icd*.json' 2>/dev/null | grep . >/dev/null &&
        ldconfig -p | grep 'libvulkan\.so\.1' >/dev/null
}
has_validation() {
    find /usr/share/vulkan /etc/vulkan -name 'VkLayer_khronos_validation.json' 2>/dev/null | grep . >/dev/null
}
# The driver, and the layer that checks what it is told: builds with debug assertions ask for it, and .ci/validation.txt has its messages
# end the test.
set_up_gpu() {
    has_gpu || apt_install mesa-vulkan-drivers libvulkan1
    has_validation || apt_install vulkan-validationlayers
    # Without names for debuggers: the layer of Debian 12 does not know the source language WGSL, and would not look at the shaders.
    export VK_LAYER_SETTINGS_PATH=$PWD/.ci/validation.txt WGPU_DEBUG=0
    # Drivers look for a display server there, and complain aloud if the folder is missing.
    if [ ! -d "${XDG_RUNTIME_DIR-}" ]; then
        export XDG_RUNTIME_DIR=$scratch/runtime
        mkdir -p -m 700 "$XDG_RUNTIME_DIR"
    fi
}

# A second Vulkan driver in software, SwiftShader, from Debian's package of Chromium; taken out of it, since the rest is not needed.
# $swiftshader is the file that VK_DRIVER_FILES names.
set_up_swiftshader() {
    local folder=$scratch/swiftshader
    swiftshader=$folder/usr/lib/chromium/vk_swiftshader_icd.json
    [ ! -e "$swiftshader" ] || return 0
    if ! command -v apt-get >/dev/null || ! command -v dpkg >/dev/null; then
        echo "no SwiftShader: it comes from Debian's package chromium-common, and there is no apt-get here" >&2
        return 1
    fi
    rm -rf "$folder"
    mkdir -p "$folder"
    [ "$(id -u)" != 0 ] || apt-get update -qq
    (cd "$folder" && apt-get download -qq chromium-common && dpkg -x chromium-common_*.deb . && rm chromium-common_*.deb)
    if [ ! -e "$swiftshader" ]; then
        echo "no SwiftShader: chromium-common has no vk_swiftshader_icd.json any more" >&2
        return 1
    fi
}
