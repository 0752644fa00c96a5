//! Frames that several amplifiers read, in one HDU or in many: `--amplifiers`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ctiplan::image::fits::Fits;
use fitsio_pure::header::{Card, serialize_header};
use fitsio_pure::image::{ImageData, serialize_image};
use fitsio_pure::value::Value;
use ndarray::{Array2, s};
use serde_json::Value as Json;

const MISSION: &str = "tests/images/mission.toml";

/// EXTNAME, EXTVER, values and cards of an image.
pub(crate) type Image<'a> = (&'a str, i64, Array2<f64>, Vec<(&'a str, Value)>);

/// A FITS file with an empty primary HDU that holds the cards, and images of floats.
pub(crate) fn file(path: &Path, primary: &[(&str, Value)], images: &[Image]) {
    let card = |keyword: &str, value: &Value| Card::new(keyword, value.clone()).unwrap();
    let text = |text: &str| Value::String(text.into());
    let mut cards = vec![card("SIMPLE", &Value::Logical(true)), card("BITPIX", &Value::Integer(8))];
    cards.push(card("NAXIS", &Value::Integer(0)));
    cards.extend(primary.iter().map(|(keyword, value)| card(keyword, value)));
    let mut bytes = serialize_header(&cards).unwrap();
    for (name, version, values, more) in images {
        let (rows, columns) = values.dim();
        let whole = |number: usize| Value::Integer(number as i64);
        let mut cards = vec![card("XTENSION", &text("IMAGE")), card("BITPIX", &Value::Integer(-64))];
        cards
            .extend([("NAXIS", 2), ("NAXIS1", columns), ("NAXIS2", rows)].map(|(key, value)| card(key, &whole(value))));
        cards.extend([("PCOUNT", 0), ("GCOUNT", 1)].map(|(key, value)| card(key, &Value::Integer(value))));
        cards.extend([card("EXTNAME", &text(name)), card("EXTVER", &Value::Integer(*version))]);
        cards.extend(more.iter().map(|(keyword, value)| card(keyword, value)));
        bytes.extend(serialize_header(&cards).unwrap());
        bytes.extend(serialize_image(&ImageData::F64(values.iter().copied().collect())));
    }
    fs::write(path, bytes).unwrap();
}

/// Physical values of an HDU.
pub(crate) fn values(path: &Path, index: usize) -> Array2<f64> {
    Fits::open(path).unwrap().pixels(index).unwrap().physical()
}

pub(crate) fn run(command: &str, input: &Path, output: &Path, more: &[&str]) -> Output {
    let (input, output) = (input.to_str().unwrap(), output.to_str().unwrap());
    let arguments = [command, input, output, "--mission", MISSION, "--dose-mev-g", "1e8", "--json"];
    Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).args(more).output().unwrap()
}

pub(crate) fn work(command: &str, input: &Path, output: &Path, more: &[&str]) -> Json {
    let done = run(command, input, output, more);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    serde_json::from_slice(&done.stdout).unwrap()
}

/// A sky of 60 e- with stars, none of them symmetric.
pub(crate) fn field(rows: usize, columns: usize) -> Array2<f64> {
    Array2::from_shape_fn((rows, columns), |(row, column)| {
        60.0 + if (7 * row + 11 * column) % 37 == 5 {
            100.0 + 90.0 * ((row * columns + column) % 29) as f64
        } else {
            0.0
        }
    })
}

fn electrons() -> Vec<(&'static str, Value)> {
    vec![("BUNIT", Value::String("ELECTRONS".into()))]
}

fn table(folder: &Path, text: &str) -> PathBuf {
    let path = folder.join("amplifiers.csv");
    fs::write(&path, text).unwrap();
    path
}

fn furthest(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn quarters_of_a_table_are_those_of_split() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    file(&at("in.fits"), &[], &[("SCI", 1, field(40, 24), electrons())]);
    let table = table(
        folder.path(),
        "hdu,amplifier,section,corner,prescan_columns\n\
         \"SCI,1\",A,\"[1:12,1:20]\",lower-left,2\n\"SCI,1\",B,\"[13:24,1:20]\",lower-right,2\n\
         \"SCI,1\",C,\"[1:12,21:40]\",upper-left,2\n1,D,\"[13:24,21:40]\",upper-right,2\n",
    );
    let table = table.to_str().unwrap();
    for axis in ["parallel", "both"] {
        let options = ["--axis", axis, "--overwrite"];
        let split = [&options[..], &["--split", "both", "--prescan-px", "2"]].concat();
        work("readout", &at("in.fits"), &at("split.fits"), &split);
        let by_table = [&options[..], &["--amplifiers", table]].concat();
        let done = work("readout", &at("in.fits"), &at("table.fits"), &by_table);
        assert_eq!(values(&at("table.fits"), 1), values(&at("split.fits"), 1), "{axis}");
        let names: Vec<&str> =
            done["hdus"][1]["amplifiers"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["A", "B", "C", "D"]);
        let back = work("correct", &at("table.fits"), &at("back.fits"), &by_table);
        assert_eq!(back["hdus"][1]["converged"], true);
        let (before, trailed, after) =
            (values(&at("in.fits"), 1), values(&at("table.fits"), 1), values(&at("back.fits"), 1));
        assert!(furthest(&after, &before) < 1e-3 * furthest(&trailed, &before));
    }
}

#[test]
fn each_amplifier_has_its_gain_bias_and_traps() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let charge = field(30, 10);
    // The left half in electrons, the right half with a gain of 2 e-/DN above 100 DN; columns 9 and 10 are read by none.
    let mut stored = charge.clone();
    stored.slice_mut(s![.., 4..8]).mapv_inplace(|charge_e| charge_e / 2.0 + 100.0);
    let cards = vec![
        ("GAINR", Value::Float(2.0)),
        ("BIASR", Value::Integer(100)),
        ("LEFT", Value::String("[1:4,1:30]".into())),
    ];
    file(&at("in.fits"), &[], &[("RAW", 1, stored.clone(), cards)]);
    file(&at("plain.fits"), &[], &[("RAW", 1, charge, electrons())]);
    let table = table(
        folder.path(),
        "hdu,amplifier,section,corner,gain_e_per_dn [e-/DN],bias_dn [DN],density_factor,density_per_px:slow\n\
         RAW,left,keyword:LEFT,lower-left,1,,0.5,\nRAW,right,\"[5:8,1:30]\",lower-left,keyword:GAINR,keyword:biasr,,0\n",
    );
    let done = work(
        "readout",
        &at("in.fits"),
        &at("out.fits"),
        &["--amplifiers", table.to_str().unwrap(), "--relative", "1e-6"],
    );
    let plain = |more: &[&str]| {
        let more = [more, &["--overwrite", "--relative", "1e-6"]].concat();
        work("readout", &at("plain.fits"), &at("expected.fits"), &more);
        values(&at("expected.fits"), 1)
    };
    let out = values(&at("out.fits"), 1);
    let half: Vec<String> = ["fast", "middle", "slow"]
        .iter()
        .zip([0.06, 0.13, 0.165])
        .flat_map(|(name, density)| ["--set".to_string(), format!("detector.traps.{name}.density_per_px={density}")])
        .collect();
    let left = plain(&half.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(furthest(&out.slice(s![.., ..4]).to_owned(), &left.slice(s![.., ..4]).to_owned()) < 1e-3);
    let right = plain(&["--set", "detector.traps.slow.density_per_px=0"]);
    let right_dn = right.slice(s![.., 4..8]).mapv(|charge_e| charge_e / 2.0 + 100.0);
    assert!(furthest(&out.slice(s![.., 4..8]).to_owned(), &right_dn) < 1e-3);
    assert!(furthest(&left, &right) > 0.02, "the two halves differ in their traps");
    assert_eq!(out.slice(s![.., 8..]), stored.slice(s![.., 8..]), "pixels that no amplifier reads");
    assert_eq!(done["hdus"][1]["gain_e_per_dn"], Json::Null);
    assert_eq!(done["hdus"][1]["amplifiers"][1]["gain_e_per_dn"], 2.0);
    let history: Vec<String> = Fits::open(&at("out.fits")).unwrap().hdus[1].history().map(str::to_string).collect();
    assert!(history.iter().any(|line| line.contains("amplifier right [5:8,1:30]: gain 2 e-/DN")), "{history:?}");
}

#[test]
fn counts_with_an_overscan_need_a_bias() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let frame = |name: &str, unit: Option<&str>| {
        let unit = unit.map(|unit| ("BUNIT", Value::String(unit.into())));
        let mut dn = field(30, 8) / 2.0 + 100.0;
        dn.slice_mut(s![.., 6..]).fill(100.0);
        file(&at(name), &[], &[("RAW", 1, dn, unit.into_iter().collect())]);
    };
    frame("adu.fits", Some("adu"));
    frame("unknown.fits", None);
    let table = |bias: &str| {
        table(
            folder.path(),
            &format!("hdu,corner,overscan_columns,gain_e_per_dn [e-/DN],bias_dn [DN]\nRAW,lower-left,2,2,{bias}\n"),
        )
    };
    let options = ["--overscan-columns", "2", "--gain-e-per-dn", "2"];
    let without = table("");
    let amplifiers = ["--amplifiers", without.to_str().unwrap()];
    for (more, help) in [(&options[..], "give --bias-dn"), (&amplifiers[..], "give bias_dn in the table")] {
        let done = run("correct", &at("adu.fits"), &at("refused.fits"), more);
        let stderr = String::from_utf8(done.stderr).unwrap();
        assert_eq!(done.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains("no bias was given") && stderr.contains(help), "{stderr}");
        // Numbers of unknown unit may be electrons: they are read, and what speaks against it is said.
        let done = work("correct", &at("unknown.fits"), &at("out.fits"), &[more, &["--overwrite"]].concat());
        let warning = done["warnings"][0].as_str().unwrap();
        assert!(warning.contains("prescan and overscan of HDU 1 (RAW) hold 200.0 e- per pixel"), "{warning}");
    }
    // Given, it is used, and nothing is said.
    let with = table("100");
    let as_options = [&options[..], &["--bias-dn", "100"]].concat();
    for more in [&as_options[..], &["--amplifiers", with.to_str().unwrap()]] {
        let done = work("correct", &at("adu.fits"), &at("out.fits"), &[more, &["--overwrite"]].concat());
        assert!(done["warnings"].as_array().unwrap().is_empty(), "{done}");
    }
}

#[test]
fn segments_of_a_camera_are_read_as_their_data_sections_say() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // 3 columns of prescan, 9 of the image, 4 of overscan; 25 rows and 2 of overscan.
    let section = || vec![("DATASEC", Value::String("[4:12,1:25]".into()))];
    let names: Vec<String> = (0..16).map(|segment| format!("Segment{}{}", 1 - segment / 8, segment % 8)).collect();
    let images: Vec<_> = names
        .iter()
        .enumerate()
        .map(|(index, name)| (name.as_str(), 1, field(27, 16) + index as f64, section()))
        .collect();
    file(&at("in.fits"), &[], &images);
    let table = "missions/amplifiers/lsst_like_itl.ecsv";
    let done = work("readout", &at("in.fits"), &at("out.fits"), &["--amplifiers", table]);
    assert_eq!(done["hdus"].as_array().unwrap().iter().filter(|hdu| hdu["copied"] == false).count(), 16);
    let alike = [
        "--hdu",
        "5",
        "--gain-e-per-dn",
        "1.7",
        "--prescan-px",
        "3",
        "--overscan-columns",
        "4",
        "--overscan-rows",
        "2",
    ];
    work("readout", &at("in.fits"), &at("one.fits"), &alike);
    assert_eq!(values(&at("out.fits"), 5), values(&at("one.fits"), 5));
    assert_ne!(values(&at("out.fits"), 5), values(&at("in.fits"), 5));
}

#[test]
#[ignore = "slow: .ci/run runs it"]
fn chips_of_hubble_are_read_to_their_outer_edges() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut star = Array2::from_elem((2048, 4096), 0.0);
    star[[1000, 10]] = 50_000.0;
    star[[1000, 4000]] = 50_000.0;
    let primary = ["READNSEA", "READNSEB", "READNSEC", "READNSED"].map(|keyword| (keyword, Value::Float(4.0)));
    file(&at("in.fits"), &primary, &[("SCI", 1, star.clone(), electrons()), ("SCI", 2, star, electrons())]);
    let table = ["--amplifiers", "missions/amplifiers/hst_acs_wfc_flt.ecsv", "--axis", "both"];
    let done = work("readout", &at("in.fits"), &at("out.fits"), &table);
    assert_eq!(done["hdus"][1]["amplifiers"][0]["read_noise_e"], 4.0);
    let (lower, upper) = (values(&at("out.fits"), 1), values(&at("out.fits"), 2));
    // Trails are behind the star: away from the register and from the amplifier.
    assert!(lower[[1001, 10]] > 1.0 && lower[[999, 10]] == 0.0 && lower[[1000, 11]] > 1.0 && lower[[1000, 9]] == 0.0);
    assert!(lower[[1001, 4000]] > 1.0 && lower[[1000, 3999]] > 1.0 && lower[[1000, 4001]] == 0.0);
    assert!(upper[[999, 10]] > 1.0 && upper[[1001, 10]] == 0.0 && upper[[1000, 11]] > 1.0);
    assert!(upper[[999, 4000]] > 1.0 && upper[[1000, 3999]] > 1.0 && upper[[1000, 4001]] == 0.0);
}

#[test]
fn tables_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.fits");
    let output = folder.path().join("out.fits");
    file(&input, &[], &[("SCI", 1, field(12, 8), electrons()), ("SCI", 2, field(12, 8), vec![])]);
    for (text, message) in [
        ("hdu\nSCI\n", "it has no column `corner`"),
        ("hdu,corner\n", "the table has no rows"),
        ("hdu,corner,gain_e_dn\nSCI,lower-left,1\n", "did you mean `gain_e_per_dn`?"),
        ("hdu,corner,read_noise_e [DN]\n1,lower-left,1\n", "the unit \"DN\" cannot be converted to e-"),
        (
            "hdu,corner\n1,lower_left\n",
            "line 2: corner = \"lower_left\"\n  allowed: lower-left, lower-right, upper-left",
        ),
        ("hdu,corner\n\"SCI,3\",lower-left\n", "the file has no such HDU; it has HDU 0, HDU 1 (SCI), HDU 2 (SCI)"),
        ("hdu,corner\n0,lower-left\n", "HDU 0 is not an image"),
        ("hdu,corner\n\"SCI,x\",lower-left\n", "behind the comma an EXTVER is needed"),
        ("hdu,corner,section\n1,lower-left,\"[1:9,1:12]\"\n", "ends beyond the image of 8 columns and 12 rows"),
        ("hdu,corner,section\n1,lower-left,[1:2]\n", "a section is needed, such as [1:2048,1:2066]"),
        ("hdu,corner,section\n1,lower-left,keyword:SECT\n", "its header has no SECT"),
        ("hdu,corner,prescan_columns\n1,lower-left,8\n", "8 columns of prescan and 0 of overscan leave none"),
        ("hdu,corner,prescan_columns\n1,lower-left,1.5\n", "a whole number from 0 to 1000000 is needed"),
        ("hdu,corner,gain_e_per_dn\n2,lower-left,-1\n", "a number above 0 is needed"),
        ("hdu,corner,gain_e_per_dn\n2,lower-left,keyword:GAIN\n", "neither its header nor the primary one has GAIN"),
        ("hdu,corner\n2,lower-left\n", "give gain_e_per_dn in the table"),
        ("hdu,corner,data_section\n1,lower-left,\"[1:8,2:12]\"\n", "1 rows are read before the first row of the image"),
        (
            "hdu,corner,data_section,prescan_columns\n1,lower-left,\"[2:8,1:12]\",1\n",
            "the row has columns or rows of prescan or overscan too",
        ),
        ("hdu,corner,charge_before_e\n1,lower-left,5\n", "there are no rows between the frame and the register"),
        (
            "hdu,corner,density_per_px:odd\n1,lower-left,5\n",
            "the mission has no such species; it has fast, middle, slow",
        ),
        (
            "hdu,amplifier,corner\n1,A,lower-left\nSCI,B,lower-left\n",
            "in HDU 1 (SCI), its pixels [1:8,1:12] overlap those of A",
        ),
    ] {
        let table = table(folder.path(), text);
        let done = run("readout", &input, &output, &["--amplifiers", table.to_str().unwrap()]);
        let stderr = String::from_utf8(done.stderr).unwrap();
        assert_eq!(done.status.code(), Some(2), "{text}: {stderr}");
        assert!(stderr.contains(message), "{text}: {stderr}");
        assert!(stderr.contains("cannot use amplifiers `") && stderr.contains("amplifiers.csv`"), "{stderr}");
        assert!(!output.exists());
    }
    let table = table(folder.path(), "hdu,corner\n1,lower-left\n");
    for option in [["--corner", "lower-left"], ["--hdu", "1"], ["--bias-dn", "3"], ["--gain-keyword", "GAIN"]] {
        let more = [&["--amplifiers", table.to_str().unwrap()], &option[..]].concat();
        let done = run("readout", &input, &output, &more);
        assert_eq!(done.status.code(), Some(2));
        assert!(String::from_utf8(done.stderr).unwrap().contains("cannot be used with"));
    }
}
