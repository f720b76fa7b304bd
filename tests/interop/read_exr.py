"""Opens an EXR file with nothing but OpenEXR and numpy and compares it, bit for bit, with what it should hold.

EXPECTED.json: {"width", "height", "attributes": {name: value}, "absent": [name]}
EXPECTED.f32: little-endian floats, the planes A, B, G, R, Z one after the other.

usage: read_exr.py IMAGE.exr EXPECTED.json EXPECTED.f32
"""

import json
import sys

import numpy as np
import OpenEXR

CHANNELS = ["A", "B", "G", "R", "Z"]


def main(path, expected_path, planes_path):
    with open(expected_path, encoding="utf-8") as file:
        expected = json.load(file)
    width, height = expected["width"], expected["height"]
    planes = np.fromfile(planes_path, "<f4").reshape(len(CHANNELS), height, width)
    # Without separate channels OpenEXR would put R, G, B and A into one array.
    with OpenEXR.File(path, separate_channels=True) as file:
        header, channels = file.header(), file.channels()
        assert sorted(channels) == CHANNELS, sorted(channels)
        for name, plane in zip(CHANNELS, planes):
            pixels = channels[name].pixels
            assert pixels.dtype == np.float32 and pixels.shape == (height, width), (name, pixels.dtype, pixels.shape)
            # As integers: infinities and signs of zero count too.
            np.testing.assert_array_equal(pixels.view(np.uint32), plane.view(np.uint32), name)
        for name, value in expected["attributes"].items():
            assert header[name] == value, (name, header[name], value)
        for name in expected["absent"]:
            assert name not in header, name
        assert header["pixelAspectRatio"] == 1.0
        assert header["compression"] == OpenEXR.ZIP_COMPRESSION, header["compression"]
    print(f"ok {len(CHANNELS)} channels {len(expected['attributes'])} attributes")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
