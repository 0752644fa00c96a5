"""Images compressed by tiles, with the values that astropy reads in them.

Each file `compressed/NAME.fits` has the compressed image in HDU 1 and, as floats of 64 bits without compression, the values that
astropy reads from it in HDU 2. The images are 23 rows of 40 columns, of a sky with stars and noise (seed 5).

    python tests/golden/compressed.py            makes the files
    python tests/golden/compressed.py --check F  says whether astropy reads files that ctiplan wrote: checksums, cards, and HDU 1
                                                 equal to HDU 2 to half a unit (integers) or the rounding of its floats

Made with astropy 6.1.7 (compression by its own C code), numpy 1.26.4.
"""

import pathlib
import sys
import warnings

import numpy as np
from astropy.io import fits

FOLDER = pathlib.Path(__file__).parent / "compressed"


def field():
    random = np.random.default_rng(5)
    field = 60.0 + random.normal(0.0, 5.0, (23, 40))
    field[random.integers(0, 23, 12), random.integers(0, 40, 12)] += 3000.0 * random.random(12)
    return field


def make(name, values, **how):
    header = fits.Header()
    header["BUNIT"] = "electron"
    header["OBJECT"] = ("a field", "kept as it is")
    header["EXTVER"] = 3
    image = fits.CompImageHDU(values, header, name="SCI", **how)
    file = fits.HDUList([fits.PrimaryHDU(), image])
    path = FOLDER / f"{name}.fits"
    file.writeto(path, overwrite=True, checksum=True)
    with fits.open(path) as read:
        seen = np.array(read[1].data, dtype=np.float64)
    fits.append(path, seen, fits.Header({"EXTNAME": "VALUES"}))


def main():
    FOLDER.mkdir(exist_ok=True)
    values = field()
    floats = values.astype(np.float32)
    floats[3, 4] = np.nan
    make("rice_u16", np.rint(values).astype(np.uint16), compression_type="RICE_1")
    make("rice_i32_tiles", np.rint(1e4 * values).astype(np.int32), compression_type="RICE_1", tile_shape=(7, 16))
    make("gzip1_i16", np.rint(values).astype(np.int16), compression_type="GZIP_1")
    make("gzip2_i32", np.rint(values).astype(np.int32), compression_type="GZIP_2", tile_shape=(23, 40))
    make("rice_f32_dither1", floats, compression_type="RICE_1", quantize_level=16.0, quantize_method=1, dither_seed=7)
    make("rice_f32_dither2", floats, compression_type="RICE_1", quantize_level=16.0, quantize_method=2, dither_seed=7)
    make("rice_f64_plain", values, compression_type="RICE_1", quantize_level=16.0, quantize_method=-1)
    make("gzip2_f32_lossless", floats, compression_type="GZIP_2", quantize_level=0.0)
    make("hcompress_i32", np.rint(values).astype(np.int32), compression_type="HCOMPRESS_1")


def check(path):
    warnings.simplefilter("error")
    with fits.open(path, checksum=True) as file:
        one, two = file[1], file[2]
        assert isinstance(one, fits.CompImageHDU), path
        assert (one.header["OBJECT"], one.header["EXTVER"], one.name) == ("a field", 3, "SCI"), path
        assert "HISTORY" in one.header, path
        seen, expected = np.array(one.data, dtype=np.float64), two.data
        allowed = 0.5 if one.data.dtype.kind in "iu" else 1e-6 * np.abs(expected)
        assert np.array_equal(np.isnan(seen), np.isnan(expected)), path
        assert np.all(np.isnan(expected) | (np.abs(seen - expected) <= allowed)), path


if __name__ == "__main__":
    if sys.argv[1:2] == ["--check"]:
        for path in sys.argv[2:]:
            check(path)
    else:
        main()
