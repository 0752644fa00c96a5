//! Files of other radiation programs (`tests/radiation_files/make.py`: made-up numbers in the layouts of the programs).

use std::f64::consts::PI;
use std::fs;
use std::path::PathBuf;

use ctiplan::error::InputError;
use ctiplan::io::radiation_file::{
    Depths, Doses, Program, Quantity, SpectrumFile, Time, Times, read_dose_depth, read_dose_history, read_sectors,
    read_spectrum,
};

const FOLDER: &str = "tests/radiation_files";
const DAY_S: f64 = 86_400.0;

fn spectrum(name: &str) -> SpectrumFile {
    read_spectrum(format!("{FOLDER}/{name}")).unwrap_or_else(|error| panic!("{error}"))
}

/// The greatest relative difference.
fn apart(one: &[f64], other: &[f64]) -> f64 {
    assert_eq!(one.len(), other.len());
    one.iter().zip(other).map(|(a, b)| if a == b { 0.0 } else { (a / b - 1.0).abs() }).fold(0.0, f64::max)
}

fn kind(spectrum: &SpectrumFile) -> (Program, Quantity, Time) {
    (spectrum.program, spectrum.quantity, spectrum.time)
}

#[test]
fn trapped_protons_of_spenvis_are_fluxes_with_the_duration_of_the_mission() {
    let read = spectrum("spenvis_trapped.txt");
    assert_eq!(kind(&read), (Program::Spenvis, Quantity::Integral, Time::PerSecond));
    assert_eq!(read.energies_mev, [1.0, 10.0, 30.0, 100.0, 300.0]);
    assert_eq!(read.values, [400.0, 200.0, 100.0, 50.0, 0.0]);
    assert_eq!(read.duration_s, Some(1826.0 * DAY_S));
    assert_eq!(spectrum("spenvis_trapped_windows.txt"), read);
}

#[test]
fn segments_of_spenvis_are_averaged_by_their_durations() {
    // A fifth of the mission has ten times the flux: 0.2 x 10 + 0.8 x 1.
    let read = spectrum("spenvis_two_segments.txt");
    assert!(apart(&read.values, &[1120.0, 560.0, 280.0, 140.0, 0.0]) < 1e-12, "{:?}", read.values);
}

#[test]
fn solar_protons_of_spenvis_are_fluences_and_read_once() {
    let read = spectrum("spenvis_solar.txt");
    assert_eq!(kind(&read), (Program::Spenvis, Quantity::Integral, Time::Mission));
    assert_eq!(read.values, [1e11, 2e10, 5e9, 5e8, 5e7]);
}

#[test]
fn cosmic_rays_of_spenvis_are_the_hydrogen_of_the_ions_made_omnidirectional() {
    let read = spectrum("spenvis_cosmic.txt");
    assert_eq!(kind(&read), (Program::Spenvis, Quantity::Integral, Time::PerSecond));
    let per_m2_sr = [1000.0, 900.0, 500.0, 1.0];
    assert!(apart(&read.values, &per_m2_sr.map(|flux| flux * 4.0 * PI * 1e-4)) < 1e-14);
}

#[test]
fn the_protons_are_found_among_the_tables_of_omere() {
    let read = spectrum("omere_displacement.fle");
    assert_eq!(kind(&read), (Program::Omere, Quantity::Differential, Time::Mission));
    // Two models meet at 1 MeV: the second value holds.
    assert_eq!(read.energies_mev, [0.1, 1.0, 10.0, 100.0]);
    assert_eq!(read.values, [2e13, 3e11, 5e9, 2e8]);
    assert_eq!(read.duration_s, Some(5.0 * 365.25 * DAY_S));
    let read = spectrum("omere_trapped.flx");
    assert_eq!(kind(&read), (Program::Omere, Quantity::Integral, Time::PerSecond));
    assert_eq!(read.values, [400.0, 200.0, 50.0]);
    assert_eq!(read.duration_s, Some(1.5 * 365.25 * DAY_S));
}

#[test]
fn hydrogen_of_creme_has_energies_even_in_their_logarithm() {
    let read = spectrum("creme.flx");
    assert_eq!(kind(&read), (Program::Creme, Quantity::Differential, Time::PerSecond));
    assert!(apart(&read.energies_mev, &[0.1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5]) < 1e-12);
    assert!(apart(&read.values[..2], &[4.0 * PI * 0.1, 4.0 * PI * 0.060653]) < 1e-12);
    assert_eq!((read.shield, read.duration_s), (None, None));
    assert_eq!(spectrum("creme.trp").values[3], 4.0 * PI * 1e-4 * 1e-101);
    assert_eq!(spectrum("creme_shielded.tfx").shield.as_deref(), Some("ALUMINUM"));
}

#[test]
fn tables_are_read_by_the_names_of_their_columns_in_the_units_of_their_header() {
    let read = spectrum("spectrum.csv");
    assert_eq!(kind(&read), (Program::Table, Quantity::Integral, Time::Mission));
    assert_eq!(read.values, [1e11, 2e10, 5e8]);
    assert_eq!(read.duration_s, Some(5.0 * 365.25 * DAY_S));
    let read = spectrum("spectrum.ecsv");
    assert_eq!(kind(&read), (Program::Table, Quantity::Differential, Time::PerSecond));
    assert_eq!(read.energies_mev, [1.0, 10.0]);
    // From m-2 sr-1 GeV-1.
    assert!(apart(&read.values, &[4.0 * PI * 5e-7, 4.0 * PI * 5e-8]) < 1e-12);
}

#[test]
fn dose_histories_are_totals_or_rates_by_years_or_dates() {
    let read = read_dose_history(format!("{FOLDER}/dose_history.csv")).unwrap();
    assert_eq!(read.times, Times::SinceLaunchYr(vec![0.0, 1.5, 3.0]));
    assert_eq!(read.doses, Doses::Total(vec![0.0, 3e6, 3e6]));
    let read = read_dose_history(format!("{FOLDER}/dose_history.ecsv")).unwrap();
    let Times::Dates(dates) = &read.times else { panic!("{read:?}") };
    assert_eq!(dates[1].to_string(), "2031-06-01 12:00:00");
    assert_eq!((read.times.rows(), read.doses.values().len()), (2, 2));
    // 1 keV/g/d is 0.36525 MeV/g/yr.
    assert!(apart(read.doses.values(), &[365.25, 182.625]) < 1e-12 && matches!(read.doses, Doses::Rate(_)));
}

#[test]
fn dose_depth_curves_are_by_thickness_or_areal_density() {
    let read = read_dose_depth(format!("{FOLDER}/dose_depth.csv")).unwrap();
    assert_eq!(read.depths, Depths::ThicknessMm(vec![1.0, 10.0, 100.0]));
    assert_eq!(read.doses, Doses::Total(vec![5e8, 5e7, 5e6]));
    let read = read_dose_depth(format!("{FOLDER}/dose_depth_rate.csv")).unwrap();
    assert!(apart(read.depths.values(), &[1.0, 2.0]) < 1e-12 && matches!(read.depths, Depths::ArealDensityGCm2(_)));
    assert_eq!(read.doses, Doses::Rate(vec![5e8, 5e7]));
}

#[test]
fn weights_of_sectors_sum_to_one() {
    let read = read_sectors(format!("{FOLDER}/sectors.csv")).unwrap();
    assert_eq!(read.weights, [0.25, 0.5, 0.25]);
    assert_eq!(read.depths, Depths::ThicknessMm(vec![10.0, 20.0, 0.0]));
    let read = read_sectors(format!("{FOLDER}/sectors.ecsv")).unwrap();
    assert_eq!((read.weights, read.depths), (vec![0.5, 0.5], Depths::ArealDensityGCm2(vec![2.7, 5.4])));
}

/// Reads a file as what its name begins with, else as a spectrum.
fn refusal(file: &str) -> Option<InputError> {
    let name = file.rsplit('/').next().unwrap();
    match name.split('_').next().unwrap() {
        "history" => read_dose_history(file).err(),
        "depth" => read_dose_depth(file).err(),
        "sectors" => read_sectors(file).err(),
        _ => read_spectrum(file).err(),
    }
}

#[test]
fn what_makes_no_sense_is_refused_with_line_and_reason() {
    let entries = fs::read_dir(format!("{FOLDER}/broken")).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending != "stderr"));
    files.sort();
    assert!(files.len() >= 40);
    for file in files {
        let file = file.to_str().unwrap();
        let error = refusal(file).unwrap_or_else(|| panic!("{file} was accepted"));
        let expected = fs::read_to_string(format!("{file}.stderr")).unwrap();
        assert_eq!(format!("error: {error}\n"), expected, "{file}");
    }
}

/// Whatever is cut off or swapped, a reader refuses or reads, and does not fail.
#[test]
fn cut_and_mangled_files_are_read_or_refused() {
    let (mut read, mut refused) = (0, 0);
    let mut count = |error: Option<InputError>| match error {
        None => read += 1,
        Some(error) => {
            assert!(!error.refused.is_empty() && !error.problem.is_empty(), "{error:?}");
            refused += 1;
        }
    };
    for entry in fs::read_dir(FOLDER).unwrap() {
        let path = entry.unwrap().path();
        let Ok(whole) = fs::read(&path) else { continue };
        let file = tempfile::NamedTempFile::new().unwrap();
        let step = (whole.len() / 40).max(1);
        for end in (0..whole.len()).step_by(step) {
            let mut mangled = whole.clone();
            mangled[end] = b'9';
            for bytes in [&whole[..end], &whole[end..], &mangled] {
                fs::write(&file, bytes).unwrap();
                count(read_spectrum(&file).err());
                count(read_dose_history(&file).err());
                count(read_dose_depth(&file).err());
                count(read_sectors(&file).err());
            }
        }
    }
    // Each of the 18 files whole but for one digit has a reader; a file that ends in its header has none.
    assert!(read > 18 * 20 && refused > 18 * 20, "{read} read, {refused} refused");
}
