//! What every effect of the catalogue promises, asked of each.

use ctiplan::effect::{CATALOGUE, Entry, Reach};
use ctiplan::evaluate;
use ctiplan::mission::{Mission, ReadoutMethod};
use ctiplan::model::{Beside, Device, Model};
use ctiplan::physics::conditions::Conditions;
use ctiplan::physics::galaxy::{Profile, snr};
use ctiplan::physics::shape::{Moments, ShapeChange};
use ctiplan::readout::Downstream;
use gauss_quad::GaussLegendre;
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use toml::Value;

/// A constant dose, so that `solar-cycle` has something to change, and 16 years, so that it turns; one galaxy, coarsely.
fn mission(settings: &str) -> Mission {
    let text = format!(
        "{}{settings}",
        include_str!("../../missions/snap_l2.toml")
            .replace("duration_yr = 5.0", "duration_yr = 16.0")
            .replace("[requirement]", "[accuracy]\nsubpixel_grid = 1\n[requirement]")
    );
    let mut mission = Mission::parse(&text).unwrap();
    mission.galaxies.truncate(1);
    mission
}

fn with(entry: &Entry, table: toml::Table) -> Mission {
    let effects = toml::Table::from_iter([(entry.card.kind.to_string(), Value::Table(table))]);
    mission(&toml::to_string(&toml::Table::from_iter([("effects".to_string(), Value::Table(effects))])).unwrap())
}

/// Dose, traps, packets and shapes at several times and under several conditions.
fn all(mission: &Mission) -> Vec<f64> {
    let model = Model::new(mission);
    let mut found = Vec::new();
    for t_yr in [0.0, 0.4, 3.0, 7.9, 8.1, 15.0] {
        found.push(model.dose_mev_g(t_yr).unwrap());
        for (temperature_k, background_e) in [(133.0, 120.0), (150.0, 2.0)] {
            let at = Conditions { temperature_k, background_e, signal_e: Some(800.0), ..model.conditions(t_yr) };
            let device = model.device(&at).unwrap();
            found.extend(device.traps.iter().map(|species| species.density_per_px));
            let background_e = device.at.background_e;
            let column = Array2::from_shape_fn((30, 1), |(row, _)| background_e + if row == 9 { 800.0 } else { 0.0 });
            let downstream = Downstream { rows: 500, charge_e: background_e };
            found.extend(device.read(&column, downstream, Beside::Background).unwrap());
        }
    }
    for t_yr in [3.0, 15.0] {
        let change = model.change(0, t_yr).unwrap().unwrap_or_default();
        found.extend([change.delta_e1, change.delta_y_px, change.delta_flux, change.delta_size]);
    }
    assert!(found.iter().all(|value| value.is_finite()));
    found
}

/// Whether they differ by more than rounding, or one has more values: another species.
fn differ(one: &[f64], other: &[f64]) -> bool {
    let apart = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-6 * a.abs().max(b.abs());
    one.len() != other.len() || one.iter().zip(other).any(apart)
}

#[test]
fn an_effect_at_zero_strength_changes_no_bit() {
    let plain = all(&mission(""));
    for entry in &CATALOGUE {
        let nothing = (entry.nothing)(&mission(""));
        if entry.card.kind == "solar-cycle" {
            // Has no strength: changes nothing where the mission follows the cycle already.
            let follows = mission("").with(&[("environment.model".into(), "solar-cycle".into())]).unwrap();
            let mut twice = follows.clone();
            twice.effects.insert("solar-cycle".into(), Value::Table(nothing));
            assert_eq!(all(&follows), all(&twice));
            continue;
        }
        let extra = entry.card.kind == "extra-species";
        let mut found = all(&with(entry, nothing));
        let mut expected = plain.clone();
        if extra {
            // One more species is listed, with no traps.
            found.retain(|value| *value != 0.0);
            expected.retain(|value| *value != 0.0);
        }
        assert!(found == expected, "{}", entry.card.kind);
    }
}

#[test]
fn every_effect_changes_something_and_no_two_do_the_same() {
    let plain = all(&mission(""));
    let mut seen: Vec<(&str, Vec<f64>)> = vec![("none", plain)];
    for entry in &CATALOGUE {
        let mut table = (entry.example)(&mission(""));
        if entry.card.kind == "formula" {
            table = toml::from_str("target = \"read_e\"\nexpression = \"read_e * (1 + 0.01 * t_yr)\"").unwrap();
        }
        let found = all(&with(entry, table));
        for (other, values) in &seen {
            assert!(differ(values, &found), "{} does the same as {other}", entry.card.kind);
        }
        seen.push((entry.card.kind, found));
    }
}

/// Two tables of a kind do the same in either order, or one of them would take the place of the other, which is refused. (Serial
/// registers are passed one after the other, so that their order counts.)
#[test]
fn two_of_a_kind_add_up_or_are_refused() {
    let twice = |kind: &str, tables: [&toml::Table; 2]| {
        let tables = tables.map(|table| Value::Table(table.clone())).to_vec();
        let effects = toml::Table::from_iter([(kind.to_string(), Value::Array(tables))]);
        let text = toml::to_string(&toml::Table::from_iter([("effects".to_string(), Value::Table(effects))])).unwrap();
        let plain = include_str!("../../missions/snap_l2.toml");
        Mission::parse(&format!("{plain}\n{text}[accuracy]\nsubpixel_grid = 1\n")).map_err(|error| error.to_string())
    };
    let replacing = ["finite-capture", "notch", "well-fill", "volume-at-zero", "sacrificial-charge"];
    for entry in CATALOGUE.iter().filter(|entry| entry.card.kind != "serial-traps") {
        let kind = entry.card.kind;
        let first = (entry.example)(&mission(""));
        // The second with other numbers.
        let mut second = first.clone();
        for value in second.iter_mut().filter_map(|(_, value)| value.as_float().map(|number| (value, number))) {
            *value.0 = Value::Float(0.9 * value.1);
        }
        let [there, back] = [twice(kind, [&first, &second]), twice(kind, [&second, &first])];
        if replacing.contains(&kind) {
            assert!(there.unwrap_err().contains("take the place of the first"), "{kind}");
            continue;
        }
        let [there, back] = [there, back].map(|mission| {
            let model = Model::new(&mission.unwrap_or_else(|error| panic!("{kind}: {error}")));
            let change = model.change(0, 5.0).unwrap().unwrap();
            [model.dose_mev_g(5.0).unwrap(), change.delta_e1, change.delta_y_px, change.delta_flux]
        });
        assert!(!differ(&there, &back), "{kind}: {there:?}, {back:?}");
    }
}

#[test]
fn charge_is_conserved_where_it_should_be() {
    // A linear cloud, so that no trail lasts for ever; traps that release soon, and rows enough behind.
    let elsewhere = ["serial-traps", "signal-bounce", "signal-ringing", "formula"];
    // Without background, the smallest packets do not get past the traps that any charge reaches: a trail lasts for ever.
    let for_ever = ["volume-at-zero"];
    for entry in CATALOGUE.iter().filter(|entry| ![&elsewhere[..], &for_ever].concat().contains(&entry.card.kind)) {
        let mut table = (entry.example)(&mission(""));
        if entry.card.kind == "extra-species" {
            table.insert("release_ms".into(), 50.0.into());
        }
        if entry.card.kind == "well-fill" {
            table.insert("well_fill_power".into(), 1.5.into());
        }
        let mut mission = with(entry, table);
        mission.detector.well_fill_power = 1.0;
        for species in &mut mission.detector.traps {
            species.release_ms = species.release_ms.min(100.0);
        }
        let model = Model::new(&mission);
        let device = model.device(&Conditions { background_e: 0.0, ..model.conditions(12.0) }).unwrap();
        let column = Array2::from_shape_fn((900, 1), |(row, _)| if row < 20 { 3000.0 } else { 0.0 });
        let read = device.read(&column, Downstream { rows: 300, charge_e: 0.0 }, Beside::Background).unwrap();
        let (before, after) = (column.sum(), read.sum());
        assert!((after / before - 1.0).abs() < 1e-7, "{}: {after} of {before}", entry.card.kind);
        assert!(read != column, "{}", entry.card.kind);
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    for entry in &CATALOGUE {
        let mission = with(entry, (entry.example)(&mission("")));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| all(&mission))
        };
        assert!(on(1) == on(7), "{}", entry.card.kind);
    }
}

#[test]
fn the_whole_chain_feels_every_effect() {
    let changes = |mission: &Mission| -> Vec<f64> {
        let years = evaluate(mission).unwrap().years;
        let of = |change: ShapeChange| [change.delta_e1, change.delta_y_px, change.delta_size, change.delta_flux];
        years.iter().flat_map(|year| of(year.galaxies[0].unwrap())).collect()
    };
    let plain = changes(&mission(""));
    for entry in &CATALOGUE {
        let found = changes(&with(entry, (entry.example)(&mission(""))));
        assert!(differ(&found, &plain), "{} does not reach `evaluate`", entry.card.kind);
    }
}

#[test]
fn cards_say_what_a_reader_needs_and_names_differ() {
    for (index, entry) in CATALOGUE.iter().enumerate() {
        let card = &entry.card;
        for said in [card.adds, card.physics, card.source, card.holds, card.residuals] {
            assert!(!said.trim().is_empty() && !said.contains("  "), "{}: {said}", card.kind);
        }
        assert!(CATALOGUE[..index].iter().all(|other| other.card.kind != card.kind && other.card.adds != card.adds));
    }
}

#[test]
fn examples_and_nothings_are_read_back_as_they_are() {
    for entry in &CATALOGUE {
        for table in [(entry.example)(&mission("")), (entry.nothing)(&mission(""))] {
            let read = with(entry, table);
            assert_eq!(Mission::parse(&read.to_toml()).unwrap(), read);
        }
    }
}

/// A formula can stand in for the effects that change a condition.
#[test]
fn formulas_on_conditions_are_the_effects_they_say() {
    let effect = |text: &str| all(&mission(&format!("\n[effects.{text}\n")));
    let formula = |text: &str| effect(&format!("formula]\n{text}"));
    assert_eq!(
        formula("target = \"background_e\"\nexpression = \"background_e + 40\""),
        effect("preflash]\nelectrons = 40.0")
    );
    assert_eq!(
        formula("target = \"temperature_k\"\nexpression = \"temperature_k + dt\"\ndt = 4.0"),
        effect("temperature-offset]\nkelvin = 4.0")
    );
    // To rounding: factors are applied in another order.
    let (formula, scale) = (
        formula("target = \"density_per_px\"\nexpression = \"density_per_px * 1.5\""),
        effect("dose-scale]\nfactor = 1.5"),
    );
    assert!(formula.iter().zip(&scale).all(|(a, b)| (a - b).abs() <= 1e-9 * b.abs()));
}

/// Two flares are the sum of both; a laboratory dose knows of none.
#[test]
fn several_of_a_kind_add_up() {
    let two = "\n[[effects.solar-flare]]\nt_yr = 1.0\ndose_mev_g = 1.0e6\n[[effects.solar-flare]]\nt_yr = 2.0\ndose_mev_g = 2.0e6\n";
    let (plain, two) = (Model::new(&mission("")), Model::new(&mission(two)));
    for (t_yr, more) in [(0.5, 0.0), (1.0, 1e6), (1.5, 1e6), (2.5, 3e6)] {
        let difference = two.dose_mev_g(t_yr).unwrap() - plain.dose_mev_g(t_yr).unwrap();
        assert!((difference - more).abs() < 1e-3, "{t_yr}: {difference}");
    }
    let at = Conditions { dose_mev_g: Some(1e7), ..plain.conditions(3.0) };
    assert_eq!(plain.device(&at).unwrap().traps, two.device(&at).unwrap().traps);
}

/// A cosine has a closed form over windows, at constant rates and in annealing, and rates with a law are integrated by themselves.
#[test]
fn a_cycle_of_the_dose_rate_is_the_one_known_on_paper() {
    const CYCLE: &str = "\n[effects.cycle]\namplitude = 0.4\nperiod_yr = 9.0\npeak = 2011.5\n";
    let dose = |effects: &str, t_yr: f64| Model::new(&mission(effects)).dose_mev_g(t_yr).unwrap();
    let launch = 2009.0;
    let turn = 2.0 * std::f64::consts::PI / 9.0;
    let wave = |t_yr: f64| ((launch + t_yr - 2011.5) * turn).sin() / turn;
    for t_yr in [0.3, 4.0, 15.0] {
        let expected = dose("", 1.0) * (t_yr + 0.4 * (wave(t_yr) - wave(0.0)));
        let found = dose(CYCLE, t_yr);
        assert!((found / expected - 1.0).abs() < 1e-9, "{t_yr}: {found}, {expected}");
    }
    // With windows, a floor and an event; the same integrated step by step, as a law of the rate asks for.
    let others = format!(
        "{CYCLE}[effects.solar-cycle]\n[effects.cosmic-ray-floor]\nrate_mev_g_yr = 3.0e5\n\
         [effects.solar-flare]\nt_yr = 3.0\ndose_mev_g = 2.0e6\n"
    );
    let law =
        format!("{others}[effects.formula]\ntarget = \"dose_rate_mev_g_yr\"\nexpression = \"dose_rate_mev_g_yr\"\n");
    for t_yr in [0.4, 2.9, 3.1, 15.0] {
        let (closed, stepped) = (dose(&others, t_yr), dose(&law, t_yr));
        assert!((closed / stepped - 1.0).abs() < 1e-9, "{t_yr}: {closed}, {stepped}");
    }
    let slow = format!("{CYCLE}[effects.annealing]\ntime_yr = 1.0e9\n");
    let density = |effects: &str| Model::new(&mission(effects)).traps(12.0).unwrap()[1].density_per_px;
    assert!((density(&slow) / density(CYCLE) - 1.0).abs() < 1e-7);
}

/// First-order annealing of a constant dose rate has a closed form.
#[test]
fn annealing_and_bakeouts_are_those_known_on_paper() {
    let density = |effects: &str, t_yr: f64| Model::new(&mission(effects)).traps(t_yr).unwrap()[1].density_per_px;
    for (time_yr, t_yr) in [(4.0, 3.0), (0.01, 3.0), (300.0, 15.0), (1e-4, 0.4)] {
        let annealed = density(&format!("\n[effects.annealing]\ntime_yr = {time_yr:?}\n"), t_yr);
        let expected = density("", 1.0) * time_yr * -(-t_yr / time_yr).exp_m1();
        assert!((annealed / expected - 1.0).abs() < 1e-9, "{time_yr}, {t_yr}: {annealed}, {expected}");
    }
    let bakeout = "\n[effects.bakeout]\nt_yr = 2.0\nfraction = 0.4\n";
    let per_year = density("", 1.0);
    for (t_yr, years) in [(1.9, 1.9), (2.0, 1.2), (3.0, 0.6 * 2.0 + 1.0)] {
        let found = density(bakeout, t_yr);
        assert!((found / (per_year * years) - 1.0).abs() < 1e-9, "{t_yr}: {found}");
    }
}

/// Annealing that saturates and reverse annealing have closed forms at a constant dose rate, at launch and after a dose given at once.
#[test]
fn traps_that_remain_and_traps_that_grow_are_those_known_on_paper() {
    let model = |effects: &str| Model::new(&mission(&format!("\n[effects.prelaunch-traps]\nVV = 0.01\n{effects}")));
    let per_year = model("").traps(1.0).unwrap()[1].density_per_px - 0.01;
    for (time_yr, t_yr) in [(4.0, 3.0), (0.01, 3.0), (300.0, 15.0), (4.0, 0.4)] {
        let decayed = f64::exp(-t_yr / time_yr);
        let young_yr = time_yr * (1.0 - decayed);
        // What is made in the mission, as years of it, and what is left of one trap of t = 0, of radiation and of the fabrication.
        let laws = [
            (format!("[effects.annealing]\ntime_yr = {time_yr:?}\n"), young_yr, [decayed; 2]),
            (
                format!("[effects.annealing]\ntime_yr = {time_yr:?}\nremaining = 0.3\n"),
                0.3 * t_yr + 0.7 * young_yr,
                [0.3 + 0.7 * decayed; 2],
            ),
            (
                format!("[effects.reverse-annealing]\ntime_yr = {time_yr:?}\ngrowth = 1.7\n"),
                2.7 * t_yr - 1.7 * young_yr,
                // Traps of the fabrication are no defects that grow.
                [2.7 - 1.7 * decayed, 1.0],
            ),
        ];
        for (effects, years, [left, left_of_launch]) in laws {
            let model = model(&effects);
            let close = |found: f64, expected: f64| {
                assert!((found / expected - 1.0).abs() < 1e-9, "{effects}{t_yr}: {found}, {expected}");
            };
            close(model.traps(t_yr).unwrap()[1].density_per_px, per_year * years + 0.01 * left_of_launch);
            let at_once = Conditions { dose_mev_g: Some(model.dose_mev_g(1.0).unwrap()), ..model.conditions(t_yr) };
            close(model.device(&at_once).unwrap().traps[1].density_per_px, per_year * left + 0.01 * left_of_launch);
        }
    }
    let error =
        Mission::parse(&format!("{}[effects.annealing]\ntime_yr = 1.0\nremaining = 30\n", mission("").to_toml()));
    assert!(error.unwrap_err().to_string().contains("30 % is 0.3"));
}

/// A search tries annealing and capture with and without the key of their card that may be absent.
#[test]
fn a_search_tries_every_form_of_annealing_and_capture() {
    let at = Model::new(&mission("")).conditions(5.0);
    for (kind, optional) in [("annealing", "remaining"), ("finite-capture", "density_power")] {
        let entry = CATALOGUE.iter().find(|entry| entry.card.kind == kind).unwrap();
        let trials = (entry.trials)(&mission(""), &Reach::of([at.clone()].iter()));
        let with = trials.iter().flatten().filter(|table| table.contains_key(optional)).count();
        assert!(with > 2 && trials.len() - with > 2, "{kind}: {with} of {}", trials.len());
    }
}

/// Change of shape of the first galaxy, over so many sub-pixel positions in x and in y: nothing is left out for the sake of symmetry.
fn at_every_position(mission: &Mission, [in_x, in_y]: [u32; 2], device: &Device) -> ShapeChange {
    let galaxy = &mission.galaxies[0];
    let half_px = (5.0 * galaxy.weight_px).ceil() as usize;
    let x_px: Vec<f64> = (0..in_x).map(|index| (f64::from(index) + 0.5) / f64::from(in_x) - 0.5).collect();
    let rule: Vec<(f64, f64)> = match in_y {
        1 => vec![(0.0, 1.0)],
        _ => {
            let rule = GaussLegendre::new((in_y as usize).try_into().unwrap());
            rule.iter().map(|(y, weight)| (y / 2.0, weight / 2.0)).collect()
        }
    };
    let y_px: Vec<f64> = rule.iter().map(|(y_px, _)| *y_px).collect();
    let downstream =
        Downstream { rows: i64::from(device.at.transfers) - 1 - half_px as i64, charge_e: device.at.background_e };
    let flat = Array2::from_elem((2 * half_px + 1, 2 * half_px + 1), device.at.background_e);
    let background_e = device.expected().read(&flat, downstream, Beside::Stamp(half_px)).unwrap();
    let mut sums = [0.0; 6];
    for (index, stamp) in Profile::of(galaxy, &mission.psf).stamps(half_px, &x_px, &y_px).into_iter().enumerate() {
        let charge_e = snr::flux_e(mission, galaxy) * stamp;
        let read = device.read(&(&charge_e + &flat), downstream, Beside::Stamp(half_px)).unwrap() - &background_e;
        let [before, after] = [&charge_e, &read].map(|image| Moments::of(image, galaxy.weight_px).unwrap());
        let weight = rule[index % rule.len()].1 / f64::from(in_x);
        for (sum, value) in sums.iter_mut().zip(members(&ShapeChange::between(&before, &after))) {
            *sum += weight * value;
        }
    }
    let [delta_e1, delta_e2, delta_x_px, delta_y_px, delta_size, delta_flux] = sums;
    device.observed_change(ShapeChange { delta_e1, delta_e2, delta_x_px, delta_y_px, delta_size, delta_flux }).unwrap()
}

fn members(change: &ShapeChange) -> [f64; 6] {
    let ShapeChange { delta_e1, delta_e2, delta_x_px, delta_y_px, delta_size, delta_flux } = *change;
    [delta_e1, delta_e2, delta_x_px, delta_y_px, delta_size, delta_flux]
}

/// Positions are left out only if they are mirror images of others and the detector does not tell left from right: with every
/// effect, and with random detectors, galaxies and grids, the change is that over all positions. Where columns are independent there
/// are two in x, and more would change nothing.
#[test]
fn no_sub_pixel_position_is_left_out_that_counts() {
    let mut random = ChaCha8Rng::seed_from_u64(1722);
    let (mut wrong, mut asymmetric) = (Vec::new(), 0);
    for entry in &CATALOGUE {
        // A serial register moves charge from column to column: there the grid alone sets the positions in x.
        let columns_are_independent = entry.card.kind != "serial-traps";
        for grid in [1, 2, 3] {
            let mut mission = with(entry, (entry.example)(&mission("")));
            mission.accuracy.subpixel_grid = grid;
            mission.readout.transfers = random.random_range(40..200);
            mission.sky.background_e = random.random_range(5.0..300.0);
            mission.detector.well_fill_power = random.random_range(0.4..1.0);
            for species in &mut mission.detector.traps {
                species.density_per_px *= random.random_range(5.0..50.0);
                species.release_ms *= random.random_range(0.2..5.0);
            }
            let galaxy = &mut mission.galaxies[0];
            galaxy.weight_px = random.random_range(1.2..2.5);
            galaxy.e1 = random.random_range(-0.5..0.5);
            galaxy.flux_e = Some(random.random_range(500.0..20_000.0));
            mission.accuracy.seed = 5;
            for method in [ReadoutMethod::Exact, ReadoutMethod::MonteCarlo] {
                mission.accuracy.readout = method;
                let model = Model::new(&mission);
                let device = model.device_at(12.0).unwrap();
                let expected = members(&at_every_position(&mission, model.positions(), &device));
                let found = members(&model.change_by(0, &device).unwrap().unwrap());
                let off =
                    |expected: &[f64; 6]| found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                if off(&expected) > 1e-9 {
                    wrong.push(format!("{}, {method:?}, {grid} x {grid}: {found:?}, {expected:?}", entry.card.kind));
                }
                asymmetric += usize::from(expected[1].abs() > 1e-9);
                if method == ReadoutMethod::Exact && grid == 2 && columns_are_independent {
                    let many = members(&at_every_position(&mission, [7, grid], &device));
                    let largest = many.iter().map(|member| member.abs()).fold(0.0, f64::max);
                    if off(&many) > 1e-4 * largest {
                        wrong.push(format!("{}, two positions in x: {found:?}, seven: {many:?}", entry.card.kind));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // Serial traps, and traps at random places, do tell left from right.
    assert!(asymmetric > CATALOGUE.len(), "{asymmetric}");
}

/// Traps of launch alone, with a release time and a cloud of their own: a species of no density, and a density at launch.
#[test]
fn a_species_may_be_there_at_launch_alone_and_fill_in_its_own_way() {
    let species = |power: &str| {
        let launch = "[effects.prelaunch-traps]\nL = 0.4\n";
        let traps = format!(
            "[[detector.traps]]\nname = \"L\"\ndensity_per_px = 0\nrelease_ms = 70.0\nenergy_ev = 0.3\n{power}"
        );
        mission(&format!("\n{traps}{launch}"))
    };
    let packet = |mission: &Mission| {
        let model = Model::new(mission);
        assert_eq!(model.traps(9.0).unwrap().last().unwrap().density_per_px, 0.4);
        let column = Array2::from_shape_fn((20, 1), |(row, _)| if row == 0 { 900.0 } else { 100.0 });
        let downstream = Downstream { rows: 300, charge_e: 100.0 };
        model.device_at(0.0).unwrap().read(&column, downstream, Beside::Background).unwrap()[[0, 0]]
    };
    let (plain, flat) = (species(""), species("well_fill_power = 0.1\n"));
    assert!((packet(&plain) - packet(&flat)).abs() > 1e-3);
    // A fit can set it, and finds the same.
    let key = "detector.traps.L.well_fill_power";
    assert_eq!(flat.number(key), Some(0.1));
    let same = flat.with(&[(key.into(), plain.detector.well_fill_power.into())]).unwrap();
    assert!((packet(&same) / packet(&plain) - 1.0).abs() < 1e-12);
    let slow = format!("{}[effects.finite-capture]\ncapture_ms = 3.0\n", flat.to_toml());
    let error = Mission::parse(&slow).unwrap_err().to_string();
    assert!(error.contains("one well fill power for all species"), "{error}");
}
