//! `ctiplan catalogue`.

use super::{Report, lines, table, wrapped};
use crate::plan::catalogue::{Catalogue, Class, Epochs};

impl Report for Epochs {
    fn text(&self) -> String {
        self.0.iter().map(text).collect::<Vec<_>>().join("\n")
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header = [
            "t_yr",
            "weight_px",
            "galaxies",
            "fitted",
            "degree",
            "is_used",
            "compared",
            "error_delta_e",
            "error_delta_y",
            "error_delta_size",
            "error_delta_flux",
            "own_median",
            "own_95",
            "own_largest",
        ];
        let mut rows = vec![header.map(str::to_string).to_vec()];
        rows.extend(self.0.iter().flat_map(rows_of));
        rows
    }
}

/// The report of one epoch.
fn text(catalogue: &Catalogue) -> String {
    let mut out = wrapped(
        &format!(
            "{}, {} yr after launch, {:.3e} MeV/g: {} galaxies, {} of them interpolated. The rms |delta e| is {:.3e}.",
            catalogue.mission,
            catalogue.t_yr,
            catalogue.dose_mev_g,
            catalogue.galaxies,
            catalogue.emulated,
            catalogue.rms_delta_e
        ),
        2,
    );
    if catalogue.lost > 0 {
        out.push_str(&wrapped(&format!("{} galaxies have no measurable shape.", catalogue.lost), 2));
    }
    if catalogue.classes.is_empty() {
        return out;
    }
    out.push_str("\nErrors of the interpolation, at galaxies that were read out and not fitted\n");
    let mut errors =
        table(&["weight [px]", "galaxies", "fitted", "degree", "compared", "error", "median", "95 %", "largest"]);
    for class in &catalogue.classes {
        let held = &class.held_out;
        let [galaxies, fitted, compared] = [class.galaxies, class.fitted, held.galaxies].map(|n| n.to_string());
        let mut row = vec![class.weight_px.to_string(), galaxies, fitted, class.degree.to_string(), compared];
        row.extend([held.worst(), held.own_median, held.own_95, held.own_largest].map(|error| format!("{error:.1e}")));
        errors.add_row(row);
    }
    out.push_str(&lines(&errors));
    out.push_str(&wrapped(
        "Error: rms over the rms change, of the worst of delta_e, delta_y, delta_size and delta_flux. \
         Median, 95 % and largest: error of (delta_e1, delta_e2) of a galaxy over its own |delta e|.",
        2,
    ));
    for class in catalogue.classes.iter().filter(|class| !class.is_used) {
        out.push_str(&wrapped(&format!("\nWarning: {}", not_used(class)), 2));
    }
    out
}

/// A row for each class of an epoch.
fn rows_of(catalogue: &Catalogue) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for class in &catalogue.classes {
        let held = &class.held_out;
        let mut row = [catalogue.t_yr, class.weight_px].map(|number| number.to_string()).to_vec();
        row.extend([class.galaxies, class.fitted].map(|count| count.to_string()));
        row.push(class.degree.to_string());
        row.extend([class.is_used.to_string(), held.galaxies.to_string()]);
        let errors = [held.delta_e, held.delta_y, held.delta_size, held.delta_flux];
        row.extend(errors.map(|error| error.to_string()));
        row.extend([held.own_median, held.own_95, held.own_largest].map(|error| error.to_string()));
        rows.push(row);
    }
    rows
}

fn not_used(class: &Class) -> String {
    format!(
        "the interpolation of the galaxies with a weight of {} px is less accurate than requested, and all of them were read \
         out; a larger --accuracy, or a narrower range of galaxies, can be interpolated",
        class.weight_px
    )
}
