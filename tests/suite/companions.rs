//! Errors and data quality beside frames.

use std::path::Path;

use ctiplan::image::fits::Fits;
use ctiplan::image::{Amplifiers, Geometry, Stop, Transfers, correct, errors};
use ctiplan::mission::Mission;
use ctiplan::model::{Device, Model};
use ctiplan::physics::conditions::Conditions;
use ctiplan::readout::Method;
use fitsio_pure::value::Value;
use ndarray::Array2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::amplifiers::{field, file, run, values, work};

/// The detector of the tests with so many times its traps.
fn device(times: f64) -> Device {
    let mission = Mission::read("tests/images/mission.toml").unwrap();
    let at = Conditions { dose_mev_g: Some(1e8), ..Conditions::of(&mission, 0.0) };
    Model::new(&mission).device(&at).unwrap().with_traps_times(times, times).by(Method::Fast { relative: 1e-4 })
}

/// One amplifier for all of a frame.
fn one(device: Device, transfers: Transfers, read_noise_e: Option<f64>, (rows, columns): (usize, usize)) -> Amplifiers {
    let geometry = Geometry { transfers, rows_before: 300, columns_before: 300, ..Geometry::default() };
    let mut one = Amplifiers::one(&device, geometry, (rows, columns));
    one.0[0].read_noise_e = read_noise_e;
    one
}

/// Corrects an image until the residual is far below the noise.
fn corrected(amplifiers: &Amplifiers, observed: &Array2<f64>) -> Array2<f64> {
    let stop = Stop::at_residual(1e-4, 30);
    correct::solve(observed, None, stop, |image| amplifiers.read(image)).unwrap().image
}

/// Root mean square over the mean, in pixels of a charge from `low` to `high`.
fn rms(of: &Array2<f64>, truth: &Array2<f64>, (low, high): (f64, f64)) -> f64 {
    let counted: Vec<f64> = of
        .iter()
        .zip(truth)
        .filter(|(_, charge)| (low..high).contains(*charge))
        .map(|(value, _)| value * value)
        .collect();
    assert!(counted.len() > 30);
    (counted.iter().sum::<f64>() / counted.len() as f64).sqrt()
}

#[test]
fn propagated_errors_are_those_of_many_noisy_frames() {
    const NOISE_E: f64 = 5.0;
    const FRAMES: u64 = 40;
    let truth = field(60, 40);
    for (transfers, times) in [(Transfers::Parallel, 4.0), (Transfers::Serial, 1.0), (Transfers::Both, 2.0)] {
        let amplifiers = one(device(times), transfers, None, truth.dim());
        let observed = amplifiers.read(&truth).unwrap();
        let quiet = corrected(&amplifiers, &observed);
        let nothing = Array2::from_elem(truth.dim(), false);
        let sigma_e = Array2::from_elem(truth.dim(), NOISE_E);
        let mut predicted = Array2::<f64>::zeros(truth.dim());
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let normal = Normal::new(0.0, NOISE_E).unwrap();
        // Squares of the errors, and of the noise itself: their ratio scatters less than either.
        let (mut errors, mut noises) = (Array2::zeros(truth.dim()), Array2::zeros(truth.dim()));
        for _ in 0..FRAMES {
            let noise = Array2::from_shape_simple_fn(truth.dim(), || normal.sample(&mut random));
            let noisy = corrected(&amplifiers, &(&observed + &noise));
            // What is known of the image is what was corrected, noise and all.
            let of_this = errors::propagated(&amplifiers, &noisy, &nothing, &sigma_e).unwrap();
            predicted = predicted + of_this.mapv(|error| error * error / FRAMES as f64);
            errors = errors + (noisy - &quiet).mapv(|error: f64| error * error);
            noises = noises + noise.mapv(|noise| noise * noise);
        }
        for range in [(0.0, 100.0), (100.0, 1e5)] {
            let root = |squares: &Array2<f64>| rms(&squares.mapv(f64::sqrt), &truth, range);
            let measured = root(&errors) / root(&noises);
            let expected = root(&predicted) / NOISE_E;
            // The amplification to a tenth of itself, beside three times the scatter of the sample, some 0.1 of a pixel's noise.
            let samples =
                FRAMES as f64 * truth.iter().filter(|charge| (range.0..range.1).contains(*charge)).count() as f64;
            assert!(expected > 1.004, "{transfers:?}, {range:?}: {expected}");
            assert!(
                (measured - expected).abs() < 0.1 * (expected - 1.0) + 0.3 / samples.sqrt(),
                "{transfers:?}, {range:?}: x {measured} in frames, x {expected} propagated"
            );
        }
    }
}

#[test]
fn shot_noise_that_the_charge_had_before_the_transfers_is_not_amplified() {
    const NOISE_E: f64 = 4.0;
    const FRAMES: u64 = 60;
    let truth = field(60, 40);
    let amplifiers = one(device(4.0), Transfers::Parallel, Some(NOISE_E), truth.dim());
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let read = Normal::new(0.0, NOISE_E).unwrap();
    let mut squares = Array2::<f64>::zeros(truth.dim());
    let mut given = Array2::<f64>::zeros(truth.dim());
    for _ in 0..FRAMES {
        let collected = truth.mapv(|charge_e| Normal::new(charge_e, charge_e.sqrt()).unwrap().sample(&mut random));
        let noise = Array2::from_shape_simple_fn(truth.dim(), || read.sample(&mut random));
        let image = corrected(&amplifiers, &(amplifiers.read(&collected).unwrap() + &noise));
        squares = squares + (&image - &truth).mapv(|error| error * error);
        // Without the amplification: what the frames had before the transfers, and the read noise.
        given = given + (&collected - &truth + &noise).mapv(|error| error * error);
    }
    let observed = amplifiers.read(&truth).unwrap();
    let sigma_e = observed.mapv(|charge_e| (charge_e + NOISE_E * NOISE_E).sqrt());
    let nothing = Array2::from_elem(truth.dim(), false);
    let predicted = errors::propagated(&amplifiers, &truth, &nothing, &sigma_e).unwrap();
    let all = one(device(4.0), Transfers::Parallel, None, truth.dim());
    let all = errors::propagated(&all, &truth, &nothing, &sigma_e).unwrap();
    let sky = (0.0, 100.0);
    let ratio = |squares: &Array2<f64>| rms(&squares.mapv(f64::sqrt), &truth, sky);
    let measured = ratio(&squares) / ratio(&given);
    let expected = rms(&predicted, &truth, sky) / rms(&sigma_e, &truth, sky);
    let upper = rms(&all, &truth, sky) / rms(&sigma_e, &truth, sky);
    assert!(
        (measured - expected).abs() < 0.25 * (upper - 1.0),
        "x {measured} in frames, x {expected} propagated, x {upper} as if all were read noise"
    );
}

fn card(keyword: &'static str, text: &str) -> (&'static str, Value) {
    (keyword, Value::String(text.into()))
}

/// Two chips with errors and data quality, of which the first is beside its frame and the second before it.
fn chips(path: &Path, quality: &Array2<f64>, instrument: &str) {
    let errors = Array2::from_elem((40, 6), 5.0);
    let electrons = || vec![card("BUNIT", "ELECTRONS")];
    let other = Array2::zeros((40, 6));
    file(
        path,
        &[card("INSTRUME", instrument)],
        &[
            ("SCI", 1, field(40, 6), electrons()),
            ("ERR", 1, errors.clone(), electrons()),
            ("DQ", 1, quality.clone(), vec![]),
            ("DQ", 2, other, vec![]),
            ("ERR", 2, errors, electrons()),
            ("SCI", 2, field(40, 6), electrons()),
        ],
    );
}

const LIES: [&str; 4] = ["--transfers-before", "500", "--relative", "1e-4"];

#[test]
fn flagged_pixels_keep_their_values() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut quality = Array2::zeros((40, 6));
    quality[[10, 1]] = 256.0 + 16.0;
    quality[[12, 2]] = 2.0;
    quality[[14, 3]] = 16.0;
    chips(&at("in.fits"), &quality, "ACS");
    // Floats are no flags: data quality must be integers.
    let done = work("correct", &at("in.fits"), &at("floats.fits"), &LIES);
    assert!(done["hdus"][1]["quality"].is_null(), "{done}");
    chips_with_integers(&at("in.fits"));
    let done = work("correct", &at("in.fits"), &at("out.fits"), &LIES);
    let first = &done["hdus"][1]["quality"];
    assert_eq!(
        (&first["hdu"], &first["bad_px"], &first["saturated_px"], &first["set_px"]),
        (&3.into(), &1.into(), &1.into(), &0.into())
    );
    assert_eq!((&done["hdus"][1]["saturated_px"], &done["hdus"][1]["missing_px"]), (&1.into(), &1.into()));
    let (before, after) = (values(&at("in.fits"), 1), values(&at("out.fits"), 1));
    assert_eq!((before[[10, 1]], before[[12, 2]]), (after[[10, 1]], after[[12, 2]]));
    assert_ne!(before[[14, 3]], after[[14, 3]]);
    // The same pixels of the other chip are not flagged.
    let other = values(&at("out.fits"), 6);
    assert_ne!(other[[10, 1]], before[[10, 1]]);
    let none = ["--dq-saturated", "0", "--dq-bad", "0x10", "--overwrite"];
    let done = work("correct", &at("in.fits"), &at("out.fits"), &[&LIES[..], &none].concat());
    assert_eq!((&done["hdus"][1]["saturated_px"], &done["hdus"][1]["missing_px"]), (&0.into(), &2.into()));
}

/// Writes the data quality of `chips` as 16-bit integers.
fn chips_with_integers(path: &Path) {
    use fitsio_pure::header::{Card, serialize_header};
    use fitsio_pure::image::{ImageData, serialize_image};
    let mut fits = Fits::open(path).unwrap();
    let mut out = std::io::Cursor::new(Vec::new());
    for index in 0..fits.hdus.len() {
        if fits.hdus[index].name().as_deref() != Some("DQ") {
            fits.copy(index, &mut out).unwrap();
            continue;
        }
        let flags = fits.pixels(index).unwrap().physical();
        let whole = |keyword: &str, value: usize| Card::new(keyword, Value::Integer(value as i64)).unwrap();
        let cards = [
            Card::new("XTENSION", Value::String("IMAGE".into())).unwrap(),
            whole("BITPIX", 16),
            whole("NAXIS", 2),
            whole("NAXIS1", flags.ncols()),
            whole("NAXIS2", flags.nrows()),
            whole("PCOUNT", 0),
            whole("GCOUNT", 1),
            Card::new("EXTNAME", Value::String("DQ".into())).unwrap(),
            whole("EXTVER", fits.hdus[index].version() as usize),
        ];
        let bytes = serialize_header(&cards).unwrap();
        std::io::Write::write_all(&mut out, &bytes).unwrap();
        let data = serialize_image(&ImageData::I16(flags.iter().map(|flags| *flags as i16).collect()));
        std::io::Write::write_all(&mut out, &data).unwrap();
    }
    drop(fits);
    std::fs::write(path, out.into_inner()).unwrap();
}

#[test]
fn errors_beside_frames_are_propagated_wherever_they_stand() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    chips(&at("in.fits"), &Array2::zeros((40, 6)), "none");
    let done = work("correct", &at("in.fits"), &at("out.fits"), &LIES);
    let ratio = done["hdus"][1]["errors"]["ratio_rms"].as_f64().unwrap();
    assert!(ratio > 1.001 && ratio < 1.5, "{ratio}");
    assert_eq!(done["hdus"][6]["errors"]["hdu"], 5);
    let (first, second) = (values(&at("out.fits"), 2), values(&at("out.fits"), 5));
    assert_eq!(first, second, "equal frames have equal errors");
    assert!((first.mapv(|error| error * error).mean().unwrap().sqrt() / 5.0 - ratio).abs() < 1e-9);
    let least = first.iter().fold(f64::INFINITY, |least, error| least.min(*error));
    assert!(least > 4.9, "{least}");
    let history: Vec<String> = Fits::open(&at("out.fits")).unwrap().hdus[2].history().map(str::to_string).collect();
    assert!(history.concat().contains("errors propagated through the correction"), "{history:?}");
    work("correct", &at("in.fits"), &at("kept.fits"), &[&LIES[..], &["--keep-err"]].concat());
    assert_eq!(values(&at("kept.fits"), 2), values(&at("in.fits"), 2));
    work("readout", &at("in.fits"), &at("read.fits"), &LIES);
    assert_eq!(values(&at("read.fits"), 2), values(&at("in.fits"), 2));
}

#[test]
fn a_bit_is_set_in_uncertain_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    chips(&at("in.fits"), &Array2::zeros((40, 6)), "none");
    let bit = ["--dq-set", "32"];
    let done = run("correct", &at("in.fits"), &at("out.fits"), &bit);
    let stderr = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(2));
    assert!(
        stderr.contains("cannot set --dq-set 32 for HDU 1 (SCI)\n  the file has no data quality for it"),
        "{stderr}"
    );
    chips_with_integers(&at("in.fits"));
    // So many traps that packets are emptied.
    let heavy = ["--transfers-before", "500", "--set", "detector.traps.slow.density_per_px=30"];
    work("readout", &at("in.fits"), &at("trailed.fits"), &heavy);
    let marked = work("correct", &at("trailed.fits"), &at("marked.fits"), &heavy);
    let uncertain_px = marked["hdus"][1]["uncertain_px"].as_u64().unwrap();
    assert!(uncertain_px > 0);
    let done = work("correct", &at("trailed.fits"), &at("out.fits"), &[&heavy[..], &bit].concat());
    assert_eq!(done["hdus"][1]["quality"]["set_px"], uncertain_px);
    let flags = values(&at("out.fits"), 3);
    assert_eq!(flags.iter().filter(|flags| **flags == 32.0).count() as u64, uncertain_px);
    // Instead of extensions that mark them.
    assert_eq!(Fits::open(&at("out.fits")).unwrap().hdus.len(), 7);
    assert!(Fits::open(&at("marked.fits")).unwrap().hdus.len() > 7);
    for wrong in ["3", "x", "0"] {
        let done = run("correct", &at("in.fits"), &at("wrong.fits"), &["--dq-set", wrong]);
        assert_eq!(done.status.code(), Some(2), "{wrong}");
    }
}

#[test]
fn separated_noise_is_not_amplified() {
    // Above the shot noise of the sky, 8 e-, which hides lower read noise.
    const NOISE_E: f64 = 12.0;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (truth, noisy) = (at("truth.fits"), at("noisy.fits"));
    let electrons = || vec![card("BUNIT", "ELECTRONS")];
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut of = |rms: f64| Normal::new(0.0, rms).unwrap().sample(&mut random);
    // A few stars in a flat sky.
    let few = |(row, column): (usize, usize)| if (13 * row + 7 * column) % 501 == 3 { 2060.0_f64 } else { 60.0 };
    let sky = Array2::from_shape_fn((120, 60), few).mapv(|charge_e| charge_e + of(charge_e.sqrt()));
    file(&truth, &[], &[("SCI", 1, sky.clone(), electrons())]);
    let heavy = ["--transfers-before", "300", "--set", "detector.traps.fast.density_per_px=1"];
    work("readout", &truth, &at("trailed.fits"), &heavy);
    let trailed = values(&at("trailed.fits"), 1);
    file(&noisy, &[], &[("SCI", 1, trailed.mapv(|charge_e| charge_e + of(NOISE_E)), electrons())]);
    let corrected = |name: &str, more: &[&str]| {
        let report = work("correct", &noisy, &at(name), &[&heavy[..], &["--noise-e", "12"], more].concat());
        let error = (values(&at(name), 1) - &sky).mapv(|error| error * error).mean().unwrap().sqrt();
        (error, report["hdus"][1].clone())
    };
    let (plain_e, plain) = corrected("plain.fits", &[]);
    let (separated_e, separated) = corrected("separated.fits", &["--separate-noise", "--read-noise-e", "12"]);
    let times = |done: &serde_json::Value| done["noise_amplification"].as_f64().unwrap();
    // The noise that was added is followed rightly, and most of its amplification is avoided.
    assert!((plain_e / NOISE_E - times(&plain)).abs() < 0.02, "{plain_e} e-, {plain}");
    assert!(plain_e > 1.03 * NOISE_E, "{plain_e}");
    assert!(separated_e - NOISE_E < 0.5 * (plain_e - NOISE_E), "{separated_e} e- instead of {plain_e}");
    let next = |done: &serde_json::Value| done["noise_correlation"]["rows"][0].as_f64().unwrap();
    assert!(next(&plain) < -0.01 && next(&separated) > next(&plain) + 0.005, "{} {}", next(&plain), next(&separated));
    assert!(plain["noise_correlation"]["columns"][0].as_f64().unwrap().abs() < 0.01);
    let history: Vec<String> =
        Fits::open(&at("separated.fits")).unwrap().hdus[1].history().map(str::to_string).collect();
    assert!(history.iter().any(|line| line == "read noise of 12 e- separated before the correction"), "{history:?}");
    let done = run("correct", &noisy, &at("no.fits"), &["--separate-noise"]);
    let stderr = String::from_utf8(done.stderr).unwrap();
    assert!(done.status.code() == Some(2) && stderr.contains("the read noise is not known"), "{stderr}");
}

#[test]
fn errors_of_another_size_are_copied_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let unit = || vec![("BUNIT", Value::String("electron".into()))];
    file(&at("in.fits"), &[], &[("SCI", 1, field(20, 5), unit()), ("ERR", 1, field(18, 5), unit())]);
    let done = work("correct", &at("in.fits"), &at("out.fits"), &LIES);
    let warnings = done["warnings"].to_string();
    assert!(warnings.contains("has another size") && warnings.contains("(ERR)"), "{warnings}");
    assert_eq!(values(&at("out.fits"), 2), values(&at("in.fits"), 2));
}
