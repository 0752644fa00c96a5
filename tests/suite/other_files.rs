//! Files as other projects write them: which images are frames, and what their headers say.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use ctiplan::image::fits::Fits;

use crate::amplifiers::{run, values, work};

const ROWS: usize = 24;
const COLUMNS: usize = 16;

/// A card, as it is written.
fn card(text: &str) -> Vec<u8> {
    format!("{text:80}").into_bytes()
}

/// A header with these cards, and data, each in whole blocks.
fn hdu(cards: &[String], data: &[u8]) -> Vec<u8> {
    let mut bytes: Vec<u8> = cards.iter().flat_map(|text| card(text)).chain(card("END")).collect();
    bytes.resize(bytes.len().next_multiple_of(2880), b' ');
    bytes.extend(data);
    bytes.resize(bytes.len().next_multiple_of(2880), 0);
    bytes
}

/// Cards of an image of these axes, the first ones those of an extension or of the primary HDU.
fn image_cards(extension: bool, bitpix: i64, axes: &[usize], more: &[&str]) -> Vec<String> {
    let first = if extension { "XTENSION= 'IMAGE   '" } else { "SIMPLE  =                    T" };
    let mut cards = vec![first.to_string(), format!("BITPIX  = {bitpix:20}"), format!("NAXIS   = {:20}", axes.len())];
    cards.extend(axes.iter().enumerate().map(|(axis, length)| format!("NAXIS{:<3}= {length:20}", axis + 1)));
    if extension {
        cards.extend(["PCOUNT  =                    0".to_string(), "GCOUNT  =                    1".to_string()]);
    }
    cards.extend(more.iter().map(|card| card.to_string()));
    cards
}

/// A sky of 100 with a star and a few warm pixels.
fn sky(row: usize, column: usize) -> i16 {
    if (row, column) == (10, 5) { 20_000 } else { 100 + ((7 * row + 3 * column) % 11) as i16 }
}

fn pixels(bitpix: i64, value: impl Fn(usize, usize) -> f64) -> Vec<u8> {
    let all = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (row, column)));
    all.flat_map(|(row, column)| {
        let value = value(row, column);
        match bitpix {
            16 => (value as i16).to_be_bytes().to_vec(),
            64 => (value as i64).to_be_bytes().to_vec(),
            -32 => (value as f32).to_be_bytes().to_vec(),
            _ => value.to_be_bytes().to_vec(),
        }
    })
    .collect()
}

/// An image extension of a sky.
fn extension(bitpix: i64, more: &[&str]) -> Vec<u8> {
    let data = pixels(bitpix, |row, column| f64::from(sky(row, column)));
    hdu(&image_cards(true, bitpix, &[COLUMNS, ROWS], more), &data)
}

fn empty() -> Vec<u8> {
    hdu(&image_cards(false, 8, &[], &[]), &[])
}

/// A primary image of 16-bit integers.
fn primary(more: &[&str]) -> Vec<u8> {
    let data = pixels(16, |row, column| f64::from(sky(row, column)));
    hdu(&image_cards(false, 16, &[COLUMNS, ROWS], more), &data)
}

fn write(folder: &Path, name: &str, hdus: &[Vec<u8>]) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, hdus.concat()).unwrap();
    path
}

const LIES: [&str; 3] = ["--transfers-before", "1000", "--overwrite"];

/// What is said of a file that is refused, without line breaks.
fn refused(command: &str, input: &Path, more: &[&str]) -> String {
    let output = input.with_file_name("refused.fits");
    let done = run(command, input, &output, &[&LIES[..], more].concat());
    let stderr = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(2), "{more:?}: {stderr}");
    assert!(!output.exists());
    stderr.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The HDUs whose values change in a readout.
fn trailed(input: &Path, images: &[usize], more: &[&str]) -> (Vec<usize>, serde_json::Value) {
    let output = input.with_file_name("trailed.fits");
    let done = work("readout", input, &output, &[&LIES[..], more].concat());
    let changed = |index: &usize| values(input, *index) != values(&output, *index);
    (images.iter().copied().filter(changed).collect(), done)
}

#[test]
fn images_of_charge_alone_are_frames() {
    let folder = tempfile::tempdir().unwrap();
    let unit = "BUNIT   = 'ELECTRONS'";
    let named = |name: &str| format!("EXTNAME = '{name}'");
    let companions = ["WCSDVARR", "BPM", "UNCERT", "VAR_POISSON", "IM1_MASK", "D2IMARR", "WEIGHT"];
    let mut hdus = vec![empty(), extension(-32, &[&named("SCI"), unit])];
    hdus.extend(companions.iter().map(|name| extension(-32, &[&named(name), unit])));
    // An image that says nothing, and a line of numbers.
    hdus.push(extension(-32, &[]));
    hdus.push(hdu(&image_cards(true, -32, &[COLUMNS], &[unit]), &[0; 4 * COLUMNS]));
    let file = write(folder.path(), "in.fits", &hdus);
    for more in [&[][..], &["--gain-e-per-dn", "1"]] {
        let (changed, done) = trailed(&file, &[1, 2, 3, 4, 5, 6, 7, 8, 9], more);
        assert_eq!(changed, [1], "{done}");
        assert_eq!(done["hdus"][2]["left_out"], "a table of the distortion of coordinates");
        for hdu in 2..=10 {
            assert!(done["hdus"][hdu]["left_out"].is_string(), "HDU {hdu}: {done}");
        }
        let warnings = done["warnings"].to_string();
        assert!(
            warnings.contains("HDU 9 is left out") && warnings.contains("HDU 10 is left out (1 axis, not two)"),
            "{warnings}"
        );
    }
    // Where no image has a unit, all of two axes are frames but for companions.
    let mut hdus = vec![empty(), extension(-32, &[&named("SCI"), "CPDIS1  = 'LOOKUP  '"]), extension(-32, &[])];
    hdus.extend(companions.iter().map(|name| extension(-32, &[&named(name)])));
    hdus.push(extension(-32, &["CRPIX1  =                  0.0", "CDELT1  =                  8.0"]));
    let file = write(folder.path(), "in.fits", &hdus);
    let (changed, _) = trailed(&file, &(1..=10).collect::<Vec<_>>(), &["--gain-e-per-dn", "1"]);
    assert_eq!(changed, [1, 2]);
    // What is selected is a frame, whatever its name.
    assert_eq!(trailed(&file, &[1, 5], &["--gain-e-per-dn", "1", "--hdu", "UNCERT"]).0, [5]);
    let only = write(folder.path(), "in.fits", &[empty(), extension(-32, &[&named("MASK"), unit])]);
    let said = refused("readout", &only, &[]);
    assert!(said.contains("HDU 1 (MASK): no charge, by its name, select it with --hdu"), "{said}");
}

/// The rule for all keywords that decide values or what they mean: one card, or cards that agree.
#[test]
fn keywords_that_decide_are_unique() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("BZERO", "0", "-300"),
        ("BSCALE", "1.0", "2.0"),
        ("BLANK", "-1", "-2"),
        ("BUNIT", "'electron'", "'DN'"),
        ("EXTNAME", "'SCI'", "'DQ'"),
        ("EXTVER", "1", "2"),
        ("GAIN", "1.0", "2.0"),
        ("BITPIX", "16", "8"),
        ("NAXIS", "2", "1"),
        ("NAXIS1", "16", "8"),
        ("NAXIS2", "24", "12"),
    ];
    for (keyword, one, other) in cases {
        let of = |value: &str| format!("{keyword:8}= {value:>20}");
        let gain = ["--gain-keyword", "GAIN"];
        let gain = if keyword == "GAIN" { &gain[..] } else { &["--gain-e-per-dn", "1"] };
        let twice = |first: &str, second: &str| {
            write(folder.path(), "in.fits", &[primary(&[&of(first), "COMMENT", &of(second)])])
        };
        let is_structure = ["BITPIX", "NAXIS", "NAXIS1", "NAXIS2"].contains(&keyword);
        if !is_structure {
            trailed(&twice(one, one), &[0], gain);
        }
        for (first, second) in [(one, other), (other, one)] {
            let said = refused("readout", &twice(first, second), gain);
            let cited = |value: &str| {
                said.contains(&format!("`{}` in line", of(value).split_whitespace().collect::<Vec<_>>().join(" ")))
            };
            assert!(cited(first) && cited(second) && said.contains("contradicts itself"), "{keyword}: {said}");
        }
    }
}

#[test]
fn values_that_are_no_numbers_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for wrong in [
        "BZERO   = '32768   '",
        "BSCALE  = '1.0     '",
        "BZERO   = 32k",
        "BSCALE  =",
        "BLANK   = 1.5",
        "EXTVER  = 'one'",
        "BUNIT   = 7",
        "BZERO     32768",
    ] {
        let file = write(folder.path(), "in.fits", &[primary(&[wrong])]);
        let said = refused("readout", &file, &["--gain-e-per-dn", "1"]);
        assert!(said.contains("in line 6: ") && said.contains("is needed"), "{wrong}: {said}");
    }
}

#[test]
fn the_name_beside_that_of_fpack_counts() {
    let folder = tempfile::tempdir().unwrap();
    let both = |name: &str| ["EXTNAME = 'COMPRESSED_IMAGE'".to_string(), format!("EXTNAME = '{name}'")];
    let of = |name: &str| extension(16, &both(name).each_ref().map(String::as_str));
    let file = write(folder.path(), "in.fits", &[empty(), of("SCI"), of("DQ")]);
    assert_eq!(trailed(&file, &[1, 2], &["--gain-e-per-dn", "1"]).0, [1]);
    assert_eq!(trailed(&file, &[1, 2], &["--gain-e-per-dn", "1", "--hdu", "SCI"]).0, [1]);
}

#[test]
fn data_quality_that_an_option_needs_is_used_or_missed() {
    let folder = tempfile::tempdir().unwrap();
    let frame = extension(-32, &["EXTNAME = 'SCI'", "BUNIT   = 'electron'"]);
    let quality = |bitpix: i64| {
        let data = pixels(bitpix, |row, column| if (row, column) == (10, 5) { 1.0 } else { 0.0 });
        hdu(&image_cards(true, bitpix, &[COLUMNS, ROWS], &["EXTNAME = 'DQ'"]), &data)
    };
    let file = |quality: Option<Vec<u8>>| {
        write(folder.path(), "in.fits", &[vec![empty(), frame.clone()], quality.into_iter().collect()].concat())
    };
    let output = folder.path().join("out.fits");
    for option in ["--dq-bad", "--dq-saturated", "--dq-set"] {
        for bitpix in [Some(64), Some(-32), Some(-64), None] {
            let said = refused("correct", &file(bitpix.map(quality)), &[option, "1"]);
            assert!(said.contains(&format!("{option} 1 for HDU 1 (SCI)")), "{option}, {bitpix:?}: {said}");
            assert!(bitpix.is_none() || said.contains("holds other values than integers"), "{said}");
        }
        let file = file(Some(quality(16)));
        work("correct", &file, &output, &[&LIES[..], &[option, "1"]].concat());
        if option != "--dq-set" {
            assert_eq!(values(&file, 1)[[10, 5]], values(&output, 1)[[10, 5]], "{option}");
        }
    }
    // None is needed for no bit; one that is not used is said.
    let done = work("correct", &file(Some(quality(64))), &output, &[&LIES[..], &["--dq-bad", "0"]].concat());
    assert!(done["warnings"].to_string().contains("it is copied, and neither used nor changed"), "{done}");
}

#[test]
fn errors_of_zero_are_not_amplified() {
    let folder = tempfile::tempdir().unwrap();
    let errors = hdu(&image_cards(true, -32, &[COLUMNS, ROWS], &["EXTNAME = 'ERR'"]), &pixels(-32, |_, _| 0.0));
    let frame = extension(-32, &["EXTNAME = 'SCI'", "BUNIT   = 'electron'"]);
    let file = write(folder.path(), "in.fits", &[empty(), frame, errors]);
    let done = work("correct", &file, &folder.path().join("out.fits"), &LIES);
    assert_eq!(done["hdus"][1]["errors"]["ratio_rms"], 1.0);
}

#[test]
fn keywords_have_as_many_words_as_they_like() {
    let folder = tempfile::tempdir().unwrap();
    let long = "HIERARCH ESO DET OUT1 CONAD = 1.5 / [e-/ADU] gain";
    let (long, short) = (
        write(folder.path(), "long.fits", &[primary(&[long])]),
        write(folder.path(), "in.fits", &[primary(&["GAIN    =                  1.5"])]),
    );
    let of = |file: &Path, keyword: &str| {
        let output = file.with_extension("out");
        work("readout", file, &output, &[&LIES[..], &["--gain-keyword", keyword]].concat());
        values(&output, 0)
    };
    for keyword in ["ESO DET OUT1 CONAD", "HIERARCH ESO DET OUT1 CONAD", "eso  det out1 conad"] {
        assert_eq!(of(&long, keyword), of(&short, "GAIN"), "{keyword}");
    }
    let twice = ["HIERARCH ESO GAIN = 1.5", "HIERARCH ESO GAIN = 2.5"];
    let said =
        refused("readout", &write(folder.path(), "in.fits", &[primary(&twice)]), &["--gain-keyword", "ESO GAIN"]);
    assert!(said.contains("`HIERARCH ESO GAIN = 1.5` in line 6, `HIERARCH ESO GAIN = 2.5` in line 7"), "{said}");
}

#[test]
fn a_unit_per_pixel_is_that_of_a_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let of = |unit: &str, more: &[&str]| {
        let file = write(folder.path(), "in.fits", &[empty(), extension(-64, &[&format!("BUNIT   = '{unit}'")])]);
        trailed(&file, &[1], more).1["hdus"][1]["largest_change_e"].as_f64().unwrap()
    };
    let plain = of("electron", &[]);
    for unit in ["electron/pixel", "ELECTRONS", "e-", "e- pix-1", "electron.pixel**-1"] {
        assert_eq!(of(unit, &[]), plain, "{unit}");
    }
    for unit in ["DN/pix", "ADU", "count", "counts/pixel"] {
        assert_eq!(of(unit, &["--gain-e-per-dn", "1"]), plain, "{unit}");
    }
    // Ten electrons a unit are as many electrons as a gain of 10 makes of counts.
    assert_eq!(of("10 electron", &[]), of("adu", &["--gain-e-per-dn", "10"]));
    assert_eq!(of("10**2 adu", &["--gain-e-per-dn", "0.01"]), plain);
    for unit in ["electron/s", "DN/s/pix", "counts per second", "e- s-1"] {
        let file = write(folder.path(), "in.fits", &[empty(), extension(-64, &[&format!("BUNIT   = '{unit}'")])]);
        assert!(refused("readout", &file, &["--gain-e-per-dn", "1"]).contains("is a rate"), "{unit}");
    }
}

#[test]
fn dates_are_read_as_headers_have_them() {
    let folder = tempfile::tempdir().unwrap();
    let golden = fs::read("tests/golden/measure/flat-300-dirty.fits").unwrap();
    let measure = |text: &str, keyword: &str| {
        let end = golden.chunks_exact(80).position(|line| line.starts_with(b"END     ")).unwrap();
        let mut cards: Vec<Vec<u8>> = golden[..80 * end].chunks_exact(80).map(<[u8]>::to_vec).collect();
        cards.retain(|line| !line.starts_with(b"DATE-OBS"));
        cards.push(card(text));
        cards.push(card("END"));
        let mut bytes = cards.concat();
        bytes.resize(bytes.len().next_multiple_of(2880), b' ');
        bytes.extend(&golden[(80 * (end + 1)).next_multiple_of(2880)..]);
        let (file, table) = (folder.path().join("in.fits"), folder.path().join("out.ecsv"));
        fs::write(&file, bytes).unwrap();
        let options = "--gain-keyword GAIN --overscan-columns 8 --overscan-rows 24 --overwrite --date-keyword";
        let done = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
            .args(["measure", "eper"])
            .args([&file, &table])
            .args(options.split(' '))
            .arg(keyword)
            .output()
            .unwrap();
        match done.status.code() {
            Some(0) => Ok(fs::read_to_string(&table).unwrap()),
            _ => Err(String::from_utf8(done.stderr).unwrap()),
        }
    };
    for (text, keyword, date) in [
        ("JD      =          2458393.964", "JD", "2018-10-02T11:08:"),
        ("MJD     =            58393.464", "MJD", "2018-10-02T11:08:"),
        ("DATE-OBS= '31/12/99'", "DATE-OBS", "1999-12-31"),
        ("DATE-OBS= '2018-10-02'", "DATE-OBS", "2018-10-02"),
        ("HIERARCH ESO DATE = '2018-10-02T01:02:03'", "ESO DATE", "2018-10-02T01:02:03"),
    ] {
        let table = measure(text, keyword).unwrap_or_else(|said| panic!("{text}: {said}"));
        assert!(table.contains(date), "{text}");
    }
    for (text, keyword) in [
        ("T       =              2024.5", "T"),
        ("T       =          1538478489", "T"),
        ("T       = '31/12/1999'", "T"),
        ("T       = '8589-09-23'", "T"),
        ("T       =             9958393.", "T"),
    ] {
        let said = measure(text, keyword).expect_err(text);
        assert!(said.contains("is not a date as FITS writes it"), "{text}: {said}");
    }
}

#[test]
fn a_compressed_image_stays_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let golden = fs::read("tests/golden/compressed/rice_u16.fits").unwrap();
    // The second header, with the cards that fpack writes for an image of the primary HDU.
    let start = golden.windows(8).position(|bytes| bytes == b"XTENSION").unwrap();
    let lines = golden[start..].chunks_exact(80).position(|line| line.starts_with(b"END     ")).unwrap();
    let rest = start + (80 * (lines + 1)).next_multiple_of(2880);
    let mut header = golden[start..start + 80 * lines].to_vec();
    for text in ["ZSIMPLE =                    T", "ZEXTEND =                    T", "END"] {
        header.extend(card(text));
    }
    header.resize(header.len().next_multiple_of(2880), b' ');
    let file = write(folder.path(), "in.fits.fz", &[golden[..start].to_vec(), header, golden[rest..].to_vec()]);
    let output = folder.path().join("out.fits.fz");
    work("readout", &file, &output, &[&LIES[..], &["--hdu", "1", "--gain-e-per-dn", "1"]].concat());
    let hdu = &Fits::open(&output).unwrap().hdus[1];
    let keywords: Vec<&str> = hdu.keywords().collect();
    let place = |keyword: &str| keywords.iter().position(|known| *known == keyword);
    // funpack takes the first of them that it meets for the beginning of the image's header.
    assert!(place("ZSIMPLE").is_some() && place("ZSIMPLE") < place("ZBITPIX"), "{keywords:?}");
    assert!(place("ZEXTEND") > place("ZNAXIS2"), "{keywords:?}");
}

#[test]
fn other_compressions_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for (begin, remedy) in [
        (&b"BZh91AY"[..], "`bunzip2`"),
        (&[0x1f, 0x9d, 0x90, 0, 0, 0, 0][..], "`uncompress`"),
        (&[0xfd, b'7', b'z', b'X', b'Z', 0, 0][..], "`unxz`"),
        (&[0x28, 0xb5, 0x2f, 0xfd, 0, 0, 0][..], "`unzstd`"),
    ] {
        let said = refused("readout", &write(folder.path(), "in.fits.bz2", &[begin.to_vec()]), &[]);
        assert!(said.contains("it is compressed with") && said.contains(remedy), "{said}");
    }
    let file = write(folder.path(), "in.fits", &[primary(&["BUNIT   = 'electron'"])]);
    let done = run("readout", &file, &folder.path().join("out.fits.bz2"), &[]);
    assert_eq!(done.status.code(), Some(2));
    assert!(!folder.path().join("out.fits.bz2").exists());
}

#[test]
fn a_frame_that_was_not_pumped_is_left_out_of_its_series() {
    let folder = tempfile::tempdir().unwrap();
    let golden = |number: usize| format!("tests/golden/measure/pumped-{number}.fits");
    let table = folder.path().join("dipoles.ecsv");
    let measure = |files: &[String]| {
        let options = "--gain-keyword GAIN --overscan-columns 8 --phase-time-keyword PHASE --cycles-keyword CYCLES \
                       --species fast --overwrite --json";
        let done = Command::new(env!("CARGO_BIN_EXE_ctiplan"))
            .args(["measure", "dipoles"])
            .args(files)
            .arg(&table)
            .args(options.split_whitespace())
            .output()
            .unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let said: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        (said, fs::read_to_string(&table).unwrap().lines().filter(|line| !line.starts_with('#')).count())
    };
    let all: Vec<String> = (1..=10).map(golden).collect();
    let (said, rows) = measure(&all);
    assert!(!said["warnings"].to_string().contains("left out"), "{said}");
    // Noise alone, under the headers of frames that have dipoles.
    for number in [1, 3, 5, 7, 8] {
        let bytes = fs::read(golden(number)).unwrap();
        let end = bytes.chunks_exact(80).position(|line| line.starts_with(b"END     ")).unwrap();
        let data = (80 * (end + 1)).next_multiple_of(2880);
        let level = i16::from_be_bytes([bytes[data], bytes[data + 1]]);
        let mut flat = bytes.clone();
        for (pixel, value) in flat[data..].chunks_exact_mut(2).enumerate() {
            let noise = (pixel.wrapping_mul(2_654_435_761) >> 7) % 7;
            value.copy_from_slice(&(level + noise as i16 - 3).to_be_bytes());
        }
        let junk = folder.path().join("junk.fits");
        fs::write(&junk, flat).unwrap();
        let more = [&all[..], &[junk.to_str().unwrap().to_string()]].concat();
        let (said, with) = measure(&more);
        assert_eq!(said["counts"]["frames_left_out"], 1, "{number}: {said}");
        let warnings = said["warnings"].to_string();
        assert!(warnings.contains("junk.fits") && !warnings.contains("pumped-"), "{number}: {warnings}");
        assert!(with.abs_diff(rows) <= rows / 20, "{number}: {with} rows instead of {rows}");
    }
}
