//! Images that are compressed by tiles, and files compressed with gzip. See tests/golden/compressed.py.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::Command;

use ctiplan::image::fits::Fits;
use flate2::read::GzDecoder;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::amplifiers::{run, values, work};

const FOLDER: &str = "tests/golden/compressed";

const NAMES: [&str; 8] = [
    "rice_u16",
    "rice_i32_tiles",
    "gzip1_i16",
    "gzip2_i32",
    "rice_f32_dither1",
    "rice_f32_dither2",
    "rice_f64_plain",
    "gzip2_f32_lossless",
];

fn golden(name: &str) -> std::path::PathBuf {
    Path::new(FOLDER).join(name).with_extension("fits")
}

/// Both HDUs of a golden file at once: the compressed image, and the values that astropy reads in it.
const BOTH: [&str; 8] = ["--hdu", "1,2", "--gain-e-per-dn", "1", "--transfers-before", "500", "--axis", "both"];

#[test]
fn tiles_hold_what_astropy_reads_in_them() {
    for name in NAMES {
        let (ours, theirs) = (values(&golden(name), 1), values(&golden(name), 2));
        assert_eq!(ours.dim(), (23, 40));
        for (ours, theirs) in ours.iter().zip(&theirs) {
            // Quantized values are computed in another order of operations.
            let close = (ours - theirs).abs() <= 1e-6 * theirs.abs();
            assert!(close || (ours.is_nan() && theirs.is_nan()), "{name}: {ours}, {theirs}");
        }
    }
}

#[test]
fn compressed_images_are_written_compressed() {
    let folder = tempfile::tempdir().unwrap();
    let mut written = Vec::new();
    for name in NAMES {
        let output = folder.path().join(name).with_extension("fits");
        let done = work("readout", &golden(name), &output, &BOTH);
        assert!(done["hdus"][1]["largest_change_e"].as_f64().unwrap() > 1.0);
        let file = Fits::open(&output).unwrap();
        let hdu = &file.hdus[1];
        assert!(hdu.is_compressed(), "{name}");
        let integers = !name.contains("_f");
        let algorithm = hdu.text("ZCMPTYPE").unwrap();
        let before = Fits::open(&golden(name)).unwrap().hdus[1].text("ZCMPTYPE").unwrap();
        assert_eq!(algorithm, if integers { before } else { "GZIP_2".into() }, "{name}");
        assert_eq!((hdu.text("OBJECT").as_deref(), hdu.version()), (Some("a field"), 3));
        assert!(hdu.history().any(|line| line.starts_with("ctiplan")));
        let (image, expected) = (values(&output, 1), values(&output, 2));
        let allowed = |expected: f64| if integers { 0.5 } else { 1e-6 * expected.abs() };
        for (image, expected) in image.iter().zip(&expected) {
            let close = (image - expected).abs() <= allowed(*expected);
            assert!(close || (image.is_nan() && expected.is_nan()), "{name}: {image}, {expected}");
        }
        written.push(output);
    }
    let python = std::env::var("ASTROPY_PYTHON").unwrap_or_else(|_| "python3".into());
    let there = Command::new(&python).args(["-c", "import astropy.io.fits"]).output();
    if !there.is_ok_and(|output| output.status.success()) {
        crate::skipped::for_want_of("astropy");
        return;
    }
    let read = Command::new(&python).args(["tests/golden/compressed.py", "--check"]).args(&written).output().unwrap();
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
}

#[test]
fn a_compressed_image_that_is_not_touched_is_copied() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    work("readout", &golden("rice_u16"), &output, &["--hdu", "2", "--gain-e-per-dn", "1"]);
    let (before, after) = (fs::read(golden("rice_u16")).unwrap(), fs::read(&output).unwrap());
    let end = before.windows(8).rposition(|bytes| bytes == b"XTENSION").unwrap();
    assert_eq!(before[..end], after[..end]);
}

#[test]
fn other_compressions_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    let done = run("readout", &golden("hcompress_i32"), &output, &["--hdu", "1"]);
    assert_eq!(done.status.code(), Some(2));
    let stderr = String::from_utf8(done.stderr).unwrap();
    assert!(stderr.contains("compressed by tiles in another way than RICE_1, GZIP_1 and GZIP_2"), "{stderr}");
}

#[test]
fn files_are_read_and_written_through_gzip() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    work("readout", &golden("gzip1_i16"), &at("plain.fits"), &BOTH);
    work("readout", &golden("gzip1_i16"), &at("packed.fits.gz"), &BOTH);
    let packed = fs::read(at("packed.fits.gz")).unwrap();
    let mut unpacked = Vec::new();
    GzDecoder::new(packed.as_slice()).read_to_end(&mut unpacked).unwrap();
    assert!(unpacked == fs::read(at("plain.fits")).unwrap(), "other bytes under gzip");
    assert!(packed.len() < unpacked.len() / 2);
    work("correct", &at("packed.fits.gz"), &at("from_packed.fits"), &BOTH);
    work("correct", &at("plain.fits"), &at("from_plain.fits"), &BOTH);
    assert!(fs::read(at("from_packed.fits")).unwrap() == fs::read(at("from_plain.fits")).unwrap());
    fs::write(at("cut.fits.gz"), &packed[..packed.len() / 2]).unwrap();
    let done = run("correct", &at("cut.fits.gz"), &at("no.fits"), &BOTH);
    let stderr = String::from_utf8(done.stderr).unwrap();
    assert!(done.status.code() == Some(2) && stderr.contains("its gzip compression cannot be undone"), "{stderr}");
}

/// Files with some bytes changed are read or refused, and nothing else.
#[test]
fn broken_tiles_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.fits");
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut refused = 0;
    for name in NAMES {
        let whole = fs::read(golden(name)).unwrap();
        for _ in 0..150 {
            let mut bytes = whole.clone();
            for _ in 0..random.random_range(1..4) {
                // In the header and the tiles of HDU 1.
                let at = random.random_range(2880..bytes.len() - 8000);
                bytes[at] = if random.random() { random.random() } else { b"0123456789-"[random.random_range(0..11)] };
            }
            fs::write(&path, &bytes).unwrap();
            let read = Fits::open(&path).and_then(|mut file| match &file.hdus.get(1).map(|hdu| hdu.kind.clone()) {
                Some(ctiplan::image::fits::HduKind::Image { .. }) => {
                    file.pixels(1).map(|pixels| drop(pixels.physical()))
                }
                _ => Ok(()),
            });
            refused += usize::from(read.is_err());
        }
    }
    assert!(refused > 50, "{refused}");
}
