//! Whole frames: files in, files out.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ctiplan::image::fits::{Fits, HduKind};
use ctiplan::image::{
    Amplifiers, Corner, FrameTransport, Geometry, Split, Stop, Transfers, correct, frame, invert, uncertain,
};
use ctiplan::mission::Mission;
use ctiplan::model::Device;
use ctiplan::model::Model;
use ctiplan::physics::conditions::Conditions;
use ctiplan::readout::{Allowed, Cloud, Downstream, Method, Readout, Trap};
use fitsio_pure::block::BLOCK_SIZE;
use fitsio_pure::hdu::{Hdu, parse_fits};
use fitsio_pure::header::{Card, serialize_header};
use fitsio_pure::image::{ImageData, read_image_data, serialize_image};
use fitsio_pure::value::Value;
use ndarray::{Array2, Axis, s};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value as Json;

const MISSION: &str = "tests/images/mission.toml";
const CAMERA: &str = "tests/golden/camera.fits";
/// How frames of `camera.fits` lie on the detector.
const LIES: [&str; 8] =
    ["--prescan-px", "4", "--overscan-columns", "3", "--overscan-rows", "5", "--transfers-before", "500"];
/// The dose at which the mission's traps are those of the golden frames.
const DOSE_MEV_G: f64 = 1e8;

fn ctiplan(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).output().unwrap()
}

/// Works on a file with the mission of these tests and gives the JSON report.
fn work(command: &str, input: &Path, output: &Path, more: &[&str]) -> Json {
    let (input, output) = (input.to_str().unwrap(), output.to_str().unwrap());
    let mut arguments = vec![command, input, output, "--mission", MISSION, "--dose-mev-g", "1e8", "--json"];
    arguments.extend(more);
    let done = ctiplan(&arguments);
    let stderr = String::from_utf8(done.stderr).unwrap();
    assert!(done.status.success(), "{arguments:?}: {stderr}");
    assert_eq!(stderr, "");
    serde_json::from_slice(&done.stdout).unwrap()
}

/// What is said when work is refused, and that nothing is left behind.
fn refused(command: &str, input: &Path, more: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    let mut arguments =
        vec![command, input.to_str().unwrap(), output.to_str().unwrap(), "--mission", MISSION, "--at", "1"];
    arguments.extend(more);
    let done = ctiplan(&arguments);
    assert_eq!(done.status.code(), Some(2), "{arguments:?}");
    assert!(done.stdout.is_empty());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "something was written");
    String::from_utf8(done.stderr).unwrap()
}

fn card(keyword: &str, value: Value) -> Card {
    Card::new(keyword, value).unwrap()
}

/// An image as one FITS file, with more cards.
fn file(folder: &Path, data: &ImageData, axes: &[i64], more: &[(&str, Value)]) -> PathBuf {
    let bitpix = match data {
        ImageData::U8(_) => 8,
        ImageData::I16(_) => 16,
        ImageData::I32(_) => 32,
        ImageData::I64(_) => 64,
        ImageData::F32(_) => -32,
        ImageData::F64(_) => -64,
    };
    let mut cards = vec![card("SIMPLE", Value::Logical(true)), card("BITPIX", Value::Integer(bitpix))];
    cards.push(card("NAXIS", Value::Integer(axes.len() as i64)));
    for (axis, length) in axes.iter().enumerate() {
        cards.push(card(&format!("NAXIS{}", axis + 1), Value::Integer(*length)));
    }
    cards.extend(more.iter().map(|(keyword, value)| card(keyword, value.clone())));
    let mut bytes = serialize_header(&cards).unwrap();
    bytes.extend(serialize_image(data));
    let path = folder.join("in.fits");
    fs::write(&path, bytes).unwrap();
    path
}

fn electrons() -> (&'static str, Value) {
    ("BUNIT", Value::String("electron".into()))
}

fn hdus(path: &Path) -> (Vec<u8>, Vec<Hdu>) {
    let bytes = fs::read(path).unwrap();
    let hdus = parse_fits(&bytes).unwrap().hdus;
    (bytes, hdus)
}

fn stored(path: &Path, index: usize) -> ImageData {
    let (bytes, hdus) = hdus(path);
    read_image_data(&bytes, &hdus[index]).unwrap()
}

/// The 80-byte cards of an HDU before END.
fn cards(path: &Path, index: usize) -> Vec<String> {
    let (bytes, hdus) = hdus(path);
    let header = &bytes[hdus[index].header_start..hdus[index].data_start];
    let cards = header.chunks(80).take_while(|card| !card.starts_with(b"END     "));
    cards.map(|card| String::from_utf8(card.to_vec()).unwrap()).collect()
}

fn device(method: Method) -> Device {
    let mission = Mission::read(MISSION).unwrap();
    let at = Conditions { dose_mev_g: Some(DOSE_MEV_G), ..Conditions::of(&mission, 0.0) };
    Model::new(&mission).device(&at).unwrap().by(method)
}

fn golden() -> Json {
    serde_json::from_str(include_str!("../golden/frames.json")).unwrap()
}

fn array(rows: &Json) -> Array2<f64> {
    let rows: Vec<Vec<f64>> = serde_json::from_value(rows.clone()).unwrap();
    Array2::from_shape_fn((rows.len(), rows[0].len()), |(row, column)| rows[row][column])
}

/// The golden field at its distance from register and amplifier, with nothing around it.
fn away(transfers: Transfers) -> Geometry {
    Geometry { transfers, rows_before: 500, columns_before: 100, ..Geometry::default() }
}

fn surrounded(transfers: Transfers) -> Geometry {
    Geometry { prescan_columns: 4, overscan_columns: 3, overscan_rows: 5, ..away(transfers) }
}

fn within(frame: &Array2<f64>) -> Array2<f64> {
    let (rows, columns) = frame.dim();
    let mut whole = Array2::zeros((rows + 5, columns + 7));
    whole.slice_mut(s![..rows, 4..columns + 4]).assign(frame);
    whole
}

fn furthest(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn frames_are_those_of_arctic() {
    let golden = golden();
    let field = array(&golden["field_e"]);
    let exact = device(Method::Exact);
    for (transfers, name) in
        [(Transfers::Parallel, "parallel_e"), (Transfers::Serial, "serial_e"), (Transfers::Both, "both_e")]
    {
        let expected = array(&golden[name]);
        let read = frame::read(&exact, &away(transfers), &field).unwrap();
        let moved = furthest(&expected, &field);
        assert!(moved > 10.0, "{name}: {moved}");
        // ArCTIc's values are stored to 10 digits, of up to 6e4 e-.
        assert!(furthest(&read, &expected) < 2e-5, "{name}: {}", furthest(&read, &expected));
        let fast = frame::read(&device(Method::Fast { relative: 1e-3 }), &away(transfers), &field).unwrap();
        // Parallel and serial transfers are each as accurate as asked for, each to its own largest displacement.
        assert!(furthest(&fast, &expected) < 2e-3 * moved, "{name}: {} of {moved}", furthest(&fast, &expected));
    }
    let expected = array(&golden["dark_e"]);
    let mut read = frame::read(&exact, &surrounded(Transfers::Both), &within(&field)).unwrap();
    // ArCTIc moves the pixels of the prescan through the register like others; they hold no charge either way. Its pixels of
    // overscan exist and have traps, but nothing to catch.
    assert!(furthest(&read, &expected) < 2e-5, "{}", furthest(&read, &expected));
    assert!(read.slice(s![60.., 4..44]).iter().any(|charge| *charge > 1.0), "no trail in the overscan rows");
    assert!(read.slice(s![..60, 44..]).iter().any(|charge| *charge > 1.0), "no trail in the overscan columns");
    assert!(read.slice_mut(s![.., ..4]).iter().all(|charge| *charge == 0.0), "a trail in the prescan");
}

#[test]
fn what_the_amplifier_adds_to_dark_pixels_fills_no_traps() {
    let golden = golden();
    let device = device(Method::Exact);
    let geometry = surrounded(Transfers::Both);
    let before = within(&array(&golden["field_e"]));
    let lit = geometry.lit(before.dim());
    let noise = Array2::from_shape_fn(before.dim(), |place| if lit[place] { 0.0 } else { 37.0 });
    let quiet = frame::read(&device, &geometry, &before).unwrap();
    let noisy = frame::read(&device, &geometry, &(&before + &noise)).unwrap();
    assert!(furthest(&noisy, &(&quiet + &noise)) < 1e-9);
}

#[test]
fn a_flipped_frame_is_read_from_the_flipped_corner() {
    let golden = golden();
    let device = device(Method::Exact);
    let before = within(&array(&golden["field_e"]));
    let read = |frame: &Array2<f64>, corner, split| {
        frame::read(&device, &Geometry { corner, split, ..surrounded(Transfers::Both) }, frame).unwrap()
    };
    let expected = read(&before, Corner::LowerLeft, None);
    let flipped = |frame: &Array2<f64>, axes: &[usize]| {
        let mut view = frame.view();
        axes.iter().for_each(|axis| view.invert_axis(Axis(*axis)));
        view.to_owned()
    };
    for (corner, axes) in [(Corner::LowerRight, &[1][..]), (Corner::UpperLeft, &[0]), (Corner::UpperRight, &[0, 1])] {
        let back = flipped(&read(&flipped(&before, axes), corner, None), axes);
        assert!(furthest(&back, &expected) < 1e-9, "{corner:?}");
        assert!(furthest(&read(&before, corner, None), &expected) > 10.0, "{corner:?} changes nothing");
    }
    // Four amplifiers: each quarter is a frame of its own.
    let (rows, columns) = before.dim();
    let mut four = Array2::zeros((2 * rows, 2 * columns));
    let mut expected_four = four.clone();
    for (top, right) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let axes: Vec<usize> =
            [(top, 0), (right, 1)].iter().filter(|(far, _)| *far == 1).map(|(_, axis)| *axis).collect();
        let place = s![top * rows..(top + 1) * rows, right * columns..(right + 1) * columns];
        four.slice_mut(place).assign(&flipped(&before, &axes));
        expected_four.slice_mut(place).assign(&flipped(&expected, &axes));
    }
    assert!(furthest(&read(&four, Corner::LowerLeft, Some(Split::Both)), &expected_four) < 1e-9);
}

#[test]
fn a_correction_undoes_a_readout_to_the_accuracy_it_tells() {
    let golden = golden();
    let device = device(Method::Fast { relative: 1e-4 });
    let geometry = surrounded(Transfers::Both);
    let before = within(&array(&golden["field_e"]));
    let observed = frame::read(&device, &geometry, &before).unwrap();
    let stop = Stop::at_residual(1e-5, 20);
    let corrected = correct::solve(&observed, None, stop, |image| frame::read(&device, &geometry, image)).unwrap();
    assert!(corrected.converged, "{:?}", corrected.residuals);
    let again = frame::read(&device, &geometry, &corrected.image).unwrap();
    // Adding and subtracting rounds.
    assert!((furthest(&again, &observed) - corrected.last().max_e).abs() < 1e-9);
    let moved = furthest(&observed, &before);
    assert!(moved > 100.0 && furthest(&corrected.image, &before) < 2e-5 * moved);
    // The library's short way, for columns alone.
    let downstream = Downstream { rows: 500, charge_e: 0.0 };
    let field = array(&golden["field_e"]);
    let trailed = array(&golden["parallel_e"]);
    let corrected = correct::correct(&device.readout(), &trailed, downstream, stop);
    assert!(corrected.converged);
    // ArCTIc made the trails: to 1e-4 of the largest displacement, the accuracy of this readout.
    assert!(furthest(&corrected.image, &field) < 1e-4 * furthest(&trailed, &field));
}

/// Values that every kind of pixel can hold: a sky of 20 with two bright pixels.
fn plain() -> Vec<f64> {
    let mut values = vec![20.0; 30 * 6];
    values[7 * 6 + 2] = 90.0;
    values[20 * 6 + 4] = 110.0;
    values
}

#[test]
fn pixels_of_every_kind_come_out_as_they_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    let scaled = |scale: f64, zero: f64| move |value: &f64| (value - zero) / scale;
    let same = scaled(1.0, 0.0);
    let unsigned = scaled(1.0, 32768.0);
    let unsigned_32 = scaled(1.0, 2_147_483_648.0);
    let tenths = scaled(0.1, -5.0);
    let zero = |zero: f64| vec![("BSCALE", Value::Float(1.0)), ("BZERO", Value::Float(zero))];
    let values = plain();
    // The data, what the header says, BSCALE, BZERO, and how far a pixel may be from its value.
    let kinds = [
        (ImageData::U8(values.iter().map(|v| same(v) as u8).collect()), vec![], 1.0, 0.0, 0.5),
        (ImageData::I16(values.iter().map(|v| same(v) as i16).collect()), vec![], 1.0, 0.0, 0.5),
        (ImageData::I16(values.iter().map(|v| unsigned(v) as i16).collect()), zero(32768.0), 1.0, 32768.0, 0.5),
        (ImageData::I32(values.iter().map(|v| same(v) as i32).collect()), vec![], 1.0, 0.0, 0.5),
        (
            ImageData::I32(values.iter().map(|v| unsigned_32(v) as i32).collect()),
            zero(2_147_483_648.0),
            1.0,
            2_147_483_648.0,
            0.5,
        ),
        (
            ImageData::I16(values.iter().map(|v| tenths(v).round() as i16).collect()),
            vec![("BSCALE", Value::Float(0.1)), ("BZERO", Value::Integer(-5))],
            0.1,
            -5.0,
            0.05,
        ),
        (ImageData::F32(values.iter().map(|v| *v as f32).collect()), vec![], 1.0, 0.0, 1e-5),
        (ImageData::F64(values.clone()), vec![], 1.0, 0.0, 1e-12),
    ];
    let frame_e = Array2::from_shape_vec((30, 6), values).unwrap();
    let geometry = Geometry { rows_before: 500, ..Geometry::default() };
    let expected = frame::read(&device(Method::Fast { relative: 1e-3 }), &geometry, &frame_e).unwrap();
    assert!(furthest(&expected, &frame_e) > 2.0);
    for (data, mut more, scale, zero, allowed) in kinds {
        more.push(electrons());
        let input = file(folder.path(), &data, &[6, 30], &more);
        work("readout", &input, &output, &["--transfers-before", "500", "--overwrite"]);
        let read = stored(&output, 0);
        assert_eq!(std::mem::discriminant(&read), std::mem::discriminant(&data));
        let physical = fitsio_pure::image::apply_bscale_bzero(&read, scale, zero);
        for (value, expected) in physical.iter().zip(&expected) {
            assert!((value - expected).abs() <= allowed * (1.0 + 1e-9), "{value} for {expected}: {more:?}");
        }
        // The header: as it was, keywords that say what was done, and HISTORY.
        let (before, after) = (cards(&input, 0), cards(&output, 0));
        assert_eq!(before[..], after[..before.len()]);
        assert!(
            after.len() > before.len()
                && after[before.len()..].iter().all(|card| card.starts_with("HISTORY  ") || card.starts_with("CTI"))
        );
    }
}

#[test]
fn headers_keep_their_cards_and_other_hdus_their_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    let gain = ["--gain-keyword", "gain", "--bias-dn", "500", "--hdu", "1"];
    let report = work("readout", Path::new(CAMERA), &output, &[&LIES[..], &gain].concat());
    assert_eq!(report["hdus"][1]["gain_e_per_dn"], 1.5);
    let ((before, known), (after, new)) = (hdus(Path::new(CAMERA)), hdus(&output));
    assert_eq!(known.len(), 6);
    assert_eq!(new.len(), 6);
    for (index, (a, b)) in known.iter().zip(&new).enumerate() {
        let whole = |bytes: &[u8], hdu: &Hdu| {
            bytes[hdu.header_start..hdu.data_start + hdu.data_len.next_multiple_of(BLOCK_SIZE)].to_vec()
        };
        assert_eq!(report["hdus"][index]["copied"], index != 1);
        assert_eq!(whole(&before, a) == whole(&after, b), index != 1, "HDU {index}");
    }
    let long = cards(&output, 0);
    assert!(
        long.iter().any(|card| card.starts_with("CONTINUE")) && long.iter().any(|card| card.starts_with("HIERARCH"))
    );
    let (was, is) = (cards(Path::new(CAMERA), 1), cards(&output, 1));
    for (was, is) in was.iter().zip(&is) {
        let sum = was.starts_with("CHECKSUM") || was.starts_with("DATASUM");
        assert_eq!(was == is, !sum, "{is}");
        // Their comments stay.
        assert_eq!(was[32..], is[32..]);
    }
    assert!(is[was.len()].starts_with("CTIADDED= 'ctiplan"), "{}", is[was.len()]);
    let told = is[was.len()..].iter().find(|card| card.starts_with("HISTORY")).unwrap();
    assert!(told.contains("ctiplan") && told.contains("readout: "), "{told}");
    assert!(fitsio_pure::checksum::verify_checksum(&after, &new[1]));
    assert!(fitsio_pure::checksum::verify_datasum(&after, &new[1]));
    // A second time is told.
    let twice = folder.path().join("twice.fits");
    let report = work("readout", &output, &twice, &[&LIES[..], &gain].concat());
    assert!(report["warnings"][0].as_str().unwrap().contains("was applied to"));
}

#[test]
fn without_a_choice_images_of_charge_are_read_out_and_those_beside_them_copied() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    let counts = ["--gain-e-per-dn", "1", "--bias-dn", "0"];
    let report = work("readout", Path::new(CAMERA), &output, &[&LIES[..], &["--hdu", "sci"], &counts].concat());
    let copied: Vec<bool> = report["hdus"].as_array().unwrap().iter().map(|hdu| hdu["copied"] == true).collect();
    assert_eq!(copied, [true, false, true, true, true, false]);
    let mut fits = Fits::open(&output).unwrap();
    assert_eq!(fits.hdus[1].kind, HduKind::Image { rows: 65, columns: 47, bitpix: 16 });
    assert_eq!((&fits.hdus[0].kind, &fits.hdus[4].kind), (&HduKind::Empty, &HduKind::NoImage));
    assert!(fits.pixels(5).unwrap().physical().iter().any(|value| value.is_nan()));
    // The same without a choice: ERR and DQ are known by their names.
    let all = folder.path().join("all.fits");
    work("readout", Path::new(CAMERA), &all, &[&LIES[..], &counts].concat());
    assert_eq!(fs::read(&all).unwrap(), fs::read(&output).unwrap());
}

#[test]
fn missing_pixels_stay_missing_and_are_filled_for_the_readout() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (Path::new(CAMERA), folder.path().join("out.fits"));
    let report = work("readout", input, &output, &[&LIES[..], &["--hdu", "5"]].concat());
    assert_eq!(report["hdus"][5]["missing_px"], 4);
    let (ImageData::F32(before), ImageData::F32(after)) = (stored(input, 5), stored(&output, 5)) else { panic!() };
    let missing: Vec<usize> = (0..before.len()).filter(|pixel| !before[*pixel].is_finite()).collect();
    assert_eq!(missing.len(), 4);
    for pixel in 0..before.len() {
        assert_eq!(after[pixel].is_finite(), before[pixel].is_finite());
    }
    assert!(missing.iter().all(|pixel| after[*pixel].to_bits() == before[*pixel].to_bits()));
    // Where the sky stands in for them, what is behind them is as if they had been sky.
    let mut sky = before.clone();
    missing.iter().for_each(|pixel| sky[*pixel] = 60.0);
    let input = file(folder.path(), &ImageData::F32(sky), &[47, 65], &[electrons()]);
    let sky_output = folder.path().join("sky.fits");
    work("readout", &input, &sky_output, &LIES);
    let ImageData::F32(as_sky) = stored(&sky_output, 0) else { panic!() };
    let unlike = (0..before.len()).filter(|pixel| !missing.contains(pixel) && as_sky[*pixel] != after[*pixel]).count();
    assert_eq!(unlike, 0);
}

#[test]
fn what_follows_the_last_hdu_is_kept_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.fits"), folder.path().join("out.fits"));
    let mut bytes = fs::read(CAMERA).unwrap();
    bytes.extend(b"more of the same");
    fs::write(&input, bytes).unwrap();
    let report = work("readout", &input, &output, &["--hdu", "5"]);
    assert!(report["warnings"][0].as_str().unwrap().starts_with("16 bytes after the last HDU"), "{report}");
    assert!(fs::read(&output).unwrap().ends_with(b"more of the same"));
}

#[test]
fn blank_integers_stay_blank_and_no_charge_becomes_blank() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    let mut values: Vec<i16> = plain().iter().map(|value| *value as i16).collect();
    values[8] = -32768;
    // 19 is where the faint trails would round to.
    let blank = [("BLANK", Value::Integer(-32768)), electrons()];
    let input = file(folder.path(), &ImageData::I16(values.clone()), &[6, 30], &blank);
    let report = work("readout", &input, &output, &["--transfers-before", "500"]);
    assert_eq!(report["hdus"][0]["missing_px"], 1);
    let ImageData::I16(after) = stored(&output, 0) else { panic!() };
    let gone: Vec<usize> = (0..after.len()).filter(|pixel| after[*pixel] == -32768).collect();
    assert_eq!(gone, [8]);
    // With BLANK at a value that a pixel is read as, that pixel moves by one.
    let taken = after[7 * 6 + 2];
    assert_ne!(taken, values[7 * 6 + 2]);
    let blank = [("BLANK", Value::Integer(taken.into())), electrons()];
    values[8] = 20;
    let input = file(folder.path(), &ImageData::I16(values), &[6, 30], &blank);
    work("readout", &input, &output, &["--transfers-before", "500", "--overwrite"]);
    let ImageData::I16(after) = stored(&output, 0) else { panic!() };
    assert_eq!(after[7 * 6 + 2], taken - 1);
}

#[test]
fn values_beyond_the_type_are_cut_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    // 250 of 255: what a correction gives back does not fit.
    let mut values: Vec<u8> = plain().iter().map(|value| *value as u8).collect();
    values[20 * 6 + 4] = 250;
    let input = file(folder.path(), &ImageData::U8(values), &[6, 30], &[electrons()]);
    let report = work("correct", &input, &output, &["--transfers-before", "500"]);
    assert_eq!(report["hdus"][0]["clipped_px"], 1, "{report}");
    let ImageData::U8(after) = stored(&output, 0) else { panic!() };
    assert_eq!(after[20 * 6 + 4], 255);
}

#[test]
fn a_saturated_pixel_is_trailed_and_not_corrected() {
    let folder = tempfile::tempdir().unwrap();
    let (output, corrected) = (folder.path().join("out.fits"), folder.path().join("corrected.fits"));
    let mut values = plain();
    values[10 * 6 + 3] = 400_000.0;
    let input = file(folder.path(), &ImageData::F64(values.clone()), &[6, 30], &[electrons()]);
    let report = work("readout", &input, &output, &["--transfers-before", "500"]);
    assert_eq!(report["hdus"][0]["saturated_px"], 1);
    let ImageData::F64(trailed) = stored(&output, 0) else { panic!() };
    // All traps of 511 pixels are filled once: 0.71 per pixel, with what they release meanwhile.
    assert!((400_000.0 - trailed[63] - 0.71 * 511.0).abs() < 0.1 * 0.71 * 511.0, "{}", trailed[63]);
    let report = work("correct", &output, &corrected, &["--transfers-before", "500"]);
    assert_eq!((&report["hdus"][0]["saturated_px"], &report["hdus"][0]["converged"]), (&1.into(), &true.into()));
    let ImageData::F64(back) = stored(&corrected, 0) else { panic!() };
    assert_eq!(back[63], trailed[63]);
    // The converter may saturate before the well does.
    let more = ["--transfers-before", "500", "--saturated-dn", "70", "--overwrite"];
    let report = work("correct", &output, &corrected, &more);
    assert_eq!(report["hdus"][0]["saturated_px"], trailed.iter().filter(|charge| **charge >= 70.0).count());
    let ImageData::F64(held) = stored(&corrected, 0) else { panic!() };
    assert!(held[44] == trailed[44] && held[124] == trailed[124] && held[45] != trailed[45]);
    for pixel in (0..values.len()).filter(|pixel| *pixel != 63) {
        assert!((back[pixel] - values[pixel]).abs() < 0.05, "{}, {}", back[pixel], values[pixel]);
    }
}

#[test]
fn readout_then_correct_gives_the_frame_back() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output, back) = (Path::new(CAMERA), folder.path().join("out.fits"), folder.path().join("back.fits"));
    let options =
        [&LIES[..], &["--axis", "both", "--serial-transfers-before", "100", "--gain-keyword", "GAIN"]].concat();
    let options = [&options[..], &["--bias-dn", "500", "--hdu", "1"]].concat();
    work("readout", input, &output, &options);
    let report = work("correct", &output, &back, &[&options[..], &["--noise-e", "4"]].concat());
    let hdu = &report["hdus"][1];
    assert_eq!(hdu["converged"], true);
    // No packet is emptied here, so that nothing is marked.
    assert_eq!((&hdu["uncertain_px"], hdus(&back).1.len()), (&0.into(), 6));
    let residuals = hdu["residuals"].as_array().unwrap();
    assert_eq!(residuals.len() as u64, hdu["iterations"].as_u64().unwrap() + 1);
    assert!(residuals[residuals.len() - 1]["max_e"].as_f64() <= residuals[0]["max_e"].as_f64().map(|max| 1e-4 * max));
    let amplified = hdu["noise_amplification"].as_f64().unwrap();
    assert!((1.0..1.2).contains(&amplified), "{amplified}");
    let (ImageData::I16(before), ImageData::I16(after)) = (stored(input, 1), stored(&back, 1)) else { panic!() };
    // Both files are rounded to whole DN; a correction spreads a rounding by little.
    assert!(before.iter().zip(&after).all(|(before, after)| before.abs_diff(*after) <= 1));
    let same = before.iter().zip(&after).filter(|(before, after)| before == after).count();
    assert!(same * 100 > before.len() * 97, "{same} of {}", before.len());
    // The same seed gives the same number, on one thread too.
    let again = folder.path().join("again.fits");
    let mut arguments = vec!["correct", output.to_str().unwrap(), again.to_str().unwrap(), "--mission", MISSION];
    arguments.extend(["--dose-mev-g", "1e8", "--json", "--noise-e", "4"].iter().chain(&options));
    let one =
        Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(&arguments).env("RAYON_NUM_THREADS", "1").output().unwrap();
    assert_eq!(serde_json::from_slice::<Json>(&one.stdout).unwrap(), report);
    assert_eq!(fs::read(&again).unwrap(), fs::read(&back).unwrap());
}

/// A mission like that of these tests, with other traps (density per pixel, release time in ms = transfers) and another well.
fn mission_with(folder: &Path, traps: &[(f64, f64)], power: f64) -> PathBuf {
    let text = fs::read_to_string(MISSION).unwrap();
    let (before, rest) = text.split_once("[[detector.traps]]").unwrap();
    let rest = rest.split_once("[readout]").unwrap().1.split_once("[effects.serial-traps]").unwrap().0;
    let mut text = before.replace("well_fill_power = 0.58", &format!("well_fill_power = {power}"));
    for (index, (density, release_ms)) in traps.iter().enumerate() {
        text += &format!(
            "[[detector.traps]]\nname = \"s{index}\"\ndensity_per_px = {density}\nrelease_ms = {release_ms}\nenergy_ev = 0.3\n"
        );
    }
    let path = folder.join("mission.toml");
    fs::write(&path, text + "[readout]" + rest).unwrap();
    path
}

/// What corrections of random frames claim, and how good they are.
#[derive(Debug, Default)]
struct Claims {
    pixels: usize,
    marked: usize,
    /// Largest error of pixels that are marked, e-.
    worst_marked_e: f64,
    /// Largest error of the others over that claimed, frame by frame.
    over_claimed: Vec<f64>,
    /// Largest error claimed over the largest displacement of charge.
    claimed_over_moved: f64,
}

/// Trails of random detectors, from little damage to far too much, on random frames whose truth is known.
fn claims(frames: usize) -> Claims {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut claims = Claims::default();
    for case in 0..frames {
        let damage = 10_f64.powf(random.random_range(-1.5..0.6));
        let traps: Vec<(f64, f64)> = (0..random.random_range(1..=8))
            .map(|_| (damage * random.random_range(0.2..1.0), 10_f64.powf(random.random_range(-1.0..3.0))))
            .collect();
        let mission = mission_with(folder.path(), &traps, [0.5, 0.58, 0.8][case % 3]);
        let sky_e = [3.0, 50.0, 200.0][random.random_range(0..3)];
        let rows_before = [0, 100, 1500][random.random_range(0..3)].to_string();
        let (rows, columns) = (60, 6);
        let mut truth: Vec<f64> = (0..rows * columns).map(|_| sky_e * random.random_range(0.7..1.3)).collect();
        for _ in 0..10 {
            truth[random.random_range(0..rows * columns)] += 10_f64.powf(random.random_range(1.5..4.5));
        }
        let input = file(folder.path(), &ImageData::F64(truth.clone()), &[columns as i64, rows as i64], &[electrons()]);
        let run = |command: &str, input: &Path, output: &Path| -> Json {
            let files = [input, output].map(|path| path.to_str().unwrap());
            let options = ["--dose-mev-g", "1e8", "--transfers-before", &rows_before, "--overwrite", "--json"];
            let mission = ["--mission", mission.to_str().unwrap()];
            let done = ctiplan(&[&[command][..], &files, &mission, &options].concat());
            assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
            serde_json::from_slice(&done.stdout).unwrap()
        };
        run("readout", &input, &path("trailed.fits"));
        let report = run("correct", &path("trailed.fits"), &path("corrected.fits"));
        let (_, written) = hdus(&path("corrected.fits"));
        let marked = match written.len() {
            1 => vec![0; truth.len()],
            _ => {
                let ImageData::U8(marks) = stored(&path("corrected.fits"), 1) else { panic!() };
                assert!(cards(&path("corrected.fits"), 1).iter().any(|card| card.contains("'HDU0.UNCERTAIN'")));
                marks
            }
        };
        let ImageData::F64(corrected) = stored(&path("corrected.fits"), 0) else { panic!() };
        let done = &report["hdus"][0];
        let count = marked.iter().filter(|marked| **marked == 1).count();
        assert_eq!(done["uncertain_px"], count);
        let told = report["warnings"].as_array().unwrap().iter().any(|warning| {
            warning.as_str().unwrap().starts_with(&format!("{count} pixels of HDU 0 are uncertain by more than"))
        });
        assert_eq!(told, count > 0, "{report}");
        let claimed_e = done["error_e"].as_f64().unwrap();
        let mut worst_e = 0.0_f64;
        for ((truth, corrected), marked) in truth.iter().zip(&corrected).zip(&marked) {
            let worst_e = if *marked == 1 { &mut claims.worst_marked_e } else { &mut worst_e };
            *worst_e = worst_e.max((truth - corrected).abs());
        }
        claims.pixels += truth.len();
        claims.marked += count;
        claims.over_claimed.push(worst_e / claimed_e);
        let moved_e = done["residuals"][0]["max_e"].as_f64().unwrap();
        claims.claimed_over_moved = claims.claimed_over_moved.max(claimed_e / moved_e);
    }
    claims
}

/// A correction is as good as it claims (to a factor of 3; see docs/images.md), but for the pixels that it marks.
#[test]
fn a_correction_is_as_good_as_it_claims_but_for_pixels_that_it_marks() {
    let claims = claims(12);
    assert!(claims.over_claimed.iter().all(|ratio| *ratio < 3.0), "{claims:?}");
    // A claim is worth something: far below what was moved.
    assert!(claims.claimed_over_moved < 0.05, "{claims:?}");
    // Pixels are marked where it must be, and not without need.
    assert!(claims.worst_marked_e > 20.0 && claims.marked > 0 && claims.marked * 5 < claims.pixels, "{claims:?}");
}

/// The numbers of docs/images.md.
#[test]
#[ignore = "takes minutes; prints what corrections of 680 frames claim"]
fn expensive_claims_of_680_corrections() {
    let claims = claims(680);
    let over = claims.over_claimed.iter().filter(|ratio| **ratio > 1.0).count();
    let worst = claims.over_claimed.iter().copied().fold(0.0, f64::max);
    println!(
        "{over} of 680 frames have a larger error than claimed, up to {worst:.2} times; {} of {} pixels are marked, with \
         errors up to {:.0} e-",
        claims.marked, claims.pixels, claims.worst_marked_e
    );
    assert!(worst < 3.0, "{worst}");
}

/// A noisy sky of 60 e- with stars, from numbers that are always the same.
fn noisy(rows: usize, columns: usize) -> Array2<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut frame = Array2::from_shape_simple_fn((rows, columns), || {
        60.0 + 8.0 * ((0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0)
    });
    for _ in 0..rows * columns / 400 {
        let (row, column) = (random.random_range(0..rows), random.random_range(0..columns));
        frame[[row, column]] += 10_f64.powf(random.random_range(2.0..4.5));
    }
    frame
}

#[test]
fn an_error_asked_for_in_electrons_is_kept() {
    let before = noisy(200, 8);
    let rms = |image: &Array2<f64>| ((image - &before).mapv(|error| error * error).mean().unwrap()).sqrt();
    for traps_per_px in [1.0, 4.0] {
        let traps =
            [(0.25, 10.0), (0.25, 0.5), (0.5, 200.0)].map(|(share, time)| Trap::new(traps_per_px * share, time));
        let readout = |method| Readout { traps: traps.to_vec(), cloud: Cloud::new(161_000.0, 0.0, 0.5), method };
        for downstream in [Downstream::NONE, Downstream { rows: 900, charge_e: 60.0 }] {
            let observed = readout(Method::Exact).parallel(&before, downstream);
            assert!(rms(&observed) > 0.3);
            for asked_e in [1.0, 0.1, 0.01] {
                let fast = readout(Method::Fast { relative: 1e-3 });
                let corrected = correct::correct(&fast, &observed, downstream, Stop::at_error(asked_e, 20));
                let error_e = rms(&corrected.image);
                assert!(corrected.converged && error_e < asked_e, "{error_e} e- of {asked_e} e-");
                // The transfers turned round leave little to do.
                assert!(corrected.iterations() <= 2, "{:?}", corrected.residuals);
            }
        }
    }
}

#[test]
fn a_correction_is_the_same_for_any_number_of_threads() {
    let device = device(Method::Fast { relative: 1e-3 });
    let geometry = Geometry { rows_before: 50, ..surrounded(Transfers::Both) };
    let observed = frame::read(&device, &geometry, &noisy(90, 150)).unwrap();
    let corrected = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let amplifiers = Amplifiers::one(&device, geometry, observed.dim());
            let transport = FrameTransport::new(&amplifiers, &observed, &|_| ());
            let corrected = invert(&transport, &observed, None, Stop::at_residual(1e-4, 20)).unwrap();
            let uncertain = uncertain(&transport, &observed, None, &corrected, (1e-3, 20)).unwrap();
            (corrected, uncertain)
        })
    };
    assert!(corrected(1) == corrected(3));
}

#[test]
fn capture_that_takes_time_is_corrected_without_turning_it_round() {
    let slow = Trap { capture_transfers: 0.2, ..Trap::new(0.5, 6.0) };
    let cloud = Cloud::new(100_000.0, 0.0, 0.5);
    let readout = Readout { traps: vec![slow], cloud, method: Method::Fast { relative: 1e-4 } };
    let before = noisy(60, 4);
    let observed = readout.parallel(&before, Downstream::NONE);
    let allowed = Allowed { relative: 0.1, error_e: 0.0 };
    assert!(readout.parallel_reversed(&observed, Downstream::NONE, allowed).is_none());
    let corrected = correct::correct(&readout, &observed, Downstream::NONE, Stop::at_residual(1e-4, 20));
    assert!(corrected.converged && corrected.iterations() > 1);
    assert!(furthest(&corrected.image, &before) < 1e-3 * furthest(&observed, &before));
}

#[test]
fn noise_added_after_the_transfers_leaves_the_trails_corrected_in_the_mean() {
    // 400 columns of one star on a sky, with 5 e- of read noise each: what is left behind the star is noise alone.
    let device = device(Method::Fast { relative: 1e-3 });
    let geometry = Geometry { rows_before: 500, ..Geometry::default() };
    let mut before = Array2::from_elem((40, 400), 60.0);
    before.row_mut(10).fill(3000.0);
    let trailed = frame::read(&device, &geometry, &before).unwrap();
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    // Twelve uniform numbers make nearly a normal one.
    let observed = trailed.mapv(|charge| charge + 5.0 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0));
    let stop = Stop::at_residual(1e-4, 30);
    let corrected = correct::solve(&observed, None, stop, |image| frame::read(&device, &geometry, image)).unwrap();
    assert!(corrected.converged, "{:?}", corrected.residuals);
    let mean = |image: &Array2<f64>, row: usize| image.row(row).mean().unwrap() - 60.0;
    let (trail, left) = (mean(&trailed, 11), mean(&corrected.image, 11));
    // The mean of 400 pixels with 5 e- each is known to 0.25 e-.
    assert!(trail > 4.0 && left.abs() < 4.0 * 0.25, "{trail} e- before, {left} e- after");
    let (loss, off) = (3000.0 - trailed[[10, 0]], mean(&corrected.image, 10) + 60.0 - 3000.0);
    assert!(loss > 20.0 && off.abs() < 4.0 * 0.25, "{loss} e- lost, {off} e- off");
}

#[test]
fn what_cannot_be_used_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let camera = fs::read(CAMERA).unwrap();
    let says = |input: &Path, more: &[&str], words: &[&str]| {
        let said = refused("readout", input, more);
        for word in words {
            assert!(said.contains(word), "{word:?} is not in:\n{said}");
        }
    };
    says(&path("nothing.fits"), &[], &["cannot read", "nothing.fits"]);
    fs::write(path("text"), "[mission]\nname = \"not an image\"\n").unwrap();
    says(&path("text"), &[], &["not a FITS file"]);
    fs::write(path("empty"), "").unwrap();
    says(&path("empty"), &[], &["not a FITS file"]);
    fs::write(path("a.fits.gz"), [0x1f, 0x8b, 8, 0, 0, 0, 0, 0]).unwrap();
    says(&path("a.fits.gz"), &[], &["gzip", "truncated"]);
    fs::write(path("cut"), &camera[..camera.len() - 5000]).unwrap();
    says(&path("cut"), &[], &["HDU 5", "of which", "truncated"]);
    fs::write(path("cut"), &camera[..2880 + 2000]).unwrap();
    says(&path("cut"), &[], &["HDU 1", "ends before the header", "truncated"]);
    let mut broken = camera.clone();
    let axis = camera.windows(10).position(|bytes| bytes == b"NAXIS1  = ").unwrap();
    broken[axis + 10..axis + 30].copy_from_slice(b"                  -7");
    fs::write(path("broken"), &broken).unwrap();
    says(&path("broken"), &[], &["HDU 1", "NAXIS1 = -7"]);

    let camera = Path::new(CAMERA);
    says(camera, &["--hdu", "1"], &["HDU 1 (SCI)", "BUNIT = 'DN'", "--gain-e-per-dn"]);
    says(camera, &["--hdu", "1", "--gain-keyword", "EGAIN"], &["EGAIN", "neither"]);
    says(camera, &["--hdu", "1", "--gain-keyword", "TELESCOP"], &["TELESCOP", "in line 5: a number is needed"]);
    says(camera, &["--hdu", "5", "--gain-e-per-dn", "2"], &["BUNIT = 'ELECTRONS'", "gain of 2"]);
    says(camera, &["--hdu", "9"], &["no HDU 9", "HDU 4 (STARS)"]);
    says(camera, &["--hdu", "4"], &["HDU 4 (STARS)", "not an image"]);
    says(camera, &["--hdu", "0"], &["HDU 0", "no data"]);
    says(camera, &["--hdu", "5", "--prescan-px", "40", "--overscan-columns", "7"], &["47 x 65", "leave none"]);
    says(camera, &["--hdu", "5", "--overscan-rows", "65"], &["65 rows of overscan"]);
    says(camera, &["--hdu", "5", "--split", "rows"], &["65 rows do not make two halves"]);
    says(camera, &["--hdu", "5", "--charge-before-e", "60"], &["--transfers-before"]);
    says(camera, &["--hdu", "5", "--gain-e-per-dn", "0"], &["a number above 0"]);

    let cube = file(folder.path(), &ImageData::I16(vec![1; 24]), &[2, 3, 4], &[electrons()]);
    says(&cube, &[], &["3 axes", "plane"]);
    let wide = file(folder.path(), &ImageData::I64(vec![1; 24]), &[6, 4], &[electrons()]);
    says(&wide, &[], &["64 bits"]);
    let rate =
        file(folder.path(), &ImageData::F32(vec![1.0; 24]), &[6, 4], &[("BUNIT", Value::String("ELECTRONS/S".into()))]);
    says(&rate, &["--gain-e-per-dn", "2"], &["is a rate", "exposure time"]);
    let silent = file(folder.path(), &ImageData::F32(vec![1.0; 24]), &[6, 4], &[]);
    says(&silent, &[], &["no BUNIT", "1 where the values are electrons"]);
    let flat =
        file(folder.path(), &ImageData::I16(vec![1; 24]), &[6, 4], &[electrons(), ("BSCALE", Value::Float(0.0))]);
    says(&flat, &[], &["BSCALE = 0"]);

    let mission = fs::read_to_string(MISSION).unwrap();
    let without = mission.split("[effects.serial-traps]").next().unwrap();
    fs::write(path("parallel.toml"), without).unwrap();
    let parallel = path("parallel.toml");
    let said = ctiplan(&[
        "readout",
        CAMERA,
        path("out.fits").to_str().unwrap(),
        "--mission",
        parallel.to_str().unwrap(),
        "--at",
        "1",
        "--hdu",
        "5",
        "--axis",
        "serial",
    ]);
    assert_eq!(said.status.code(), Some(2));
    assert!(String::from_utf8(said.stderr).unwrap().contains("[effects.serial-traps]"));
}

#[test]
fn a_file_is_replaced_only_where_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    fs::write(&output, "precious").unwrap();
    let arguments = |output: &str| {
        ["readout", CAMERA, output, "--mission", MISSION, "--at", "1", "--hdu", "5"].map(str::to_string).to_vec()
    };
    let run = |output: &Path, more: &[&str]| {
        let mut arguments = arguments(output.to_str().unwrap());
        arguments.extend(more.iter().map(|more| more.to_string()));
        let done = Command::new(env!("CARGO_BIN_EXE_ctiplan")).args(arguments).output().unwrap();
        (done.status.code(), String::from_utf8(done.stderr).unwrap())
    };
    let (status, said) = run(&output, &[]);
    assert!(status == Some(2) && said.contains("exists already") && said.contains("--overwrite"), "{said}");
    assert_eq!(fs::read(&output).unwrap(), b"precious");
    assert_eq!(run(&output, &["--overwrite"]), (Some(0), String::new()));
    assert!(Fits::open(&output).is_ok());
    // Never in place.
    let before = fs::read(&output).unwrap();
    let place = output.to_str().unwrap();
    let done = ctiplan(&["readout", place, place, "--mission", MISSION, "--at", "1", "--hdu", "5", "--force"]);
    assert_eq!(done.status.code(), Some(2));
    assert_eq!(fs::read(&output).unwrap(), before);
    let (status, said) = run(&folder.path().join("nowhere/out.fits"), &[]);
    assert!(status == Some(2) && said.contains("the folder is not there"), "{said}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn tables_fit_80_columns() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.fits");
    let done = ctiplan(&[
        "correct",
        CAMERA,
        output.to_str().unwrap(),
        "--mission",
        MISSION,
        "--at",
        "4",
        "--hdu",
        "5",
        "--noise-e",
        "3",
        "--iterations",
        "1",
        "--tolerance",
        "1e-9",
    ]);
    let text = String::from_utf8(done.stdout).unwrap();
    assert!(done.status.success() && text.contains("Warning: the correction of HDU 5 (SCI) leaves"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
}
