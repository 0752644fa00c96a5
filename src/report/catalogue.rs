//! `ctiplan catalogue`.

use super::{Report, lines, table, wrapped};
use crate::plan::catalogue::{Catalogue, Class};

impl Report for Catalogue {
    fn text(&self) -> String {
        let mut out = wrapped(
            &format!(
                "{}, {} yr after launch, {:.3e} MeV/g: {} galaxies, {} of them interpolated. The rms |delta e| is {:.3e}.",
                self.mission, self.t_yr, self.dose_mev_g, self.galaxies, self.emulated, self.rms_delta_e
            ),
            2,
        );
        if self.lost > 0 {
            out.push_str(&wrapped(&format!("{} galaxies have no measurable shape.", self.lost), 2));
        }
        if self.classes.is_empty() {
            return out;
        }
        out.push_str("\nErrors of the interpolation, at galaxies that were read out and not fitted\n");
        let mut errors =
            table(&["weight [px]", "galaxies", "fitted", "degree", "compared", "error", "median", "95 %", "largest"]);
        for class in &self.classes {
            let held = &class.held_out;
            let mut row =
                [class.galaxies, class.fitted, class.degree, held.galaxies].map(|count| count.to_string()).to_vec();
            row.insert(0, class.weight_px.to_string());
            row.extend(
                [held.worst(), held.own_median, held.own_95, held.own_largest].map(|error| format!("{error:.1e}")),
            );
            errors.add_row(row);
        }
        out.push_str(&lines(&errors));
        out.push_str(&wrapped(
            "Error: rms over the rms change, of the worst of delta_e, delta_y, delta_size and delta_flux. \
             Median, 95 % and largest: error of (delta_e1, delta_e2) of a galaxy over its own |delta e|.",
            2,
        ));
        for class in self.classes.iter().filter(|class| !class.is_used) {
            out.push_str(&wrapped(&format!("\nWarning: {}", not_used(class)), 2));
        }
        out
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header = [
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
        for class in &self.classes {
            let held = &class.held_out;
            let mut row = vec![class.weight_px.to_string()];
            row.extend([class.galaxies, class.fitted, class.degree].map(|count| count.to_string()));
            row.extend([class.is_used.to_string(), held.galaxies.to_string()]);
            let errors = [held.delta_e, held.delta_y, held.delta_size, held.delta_flux];
            row.extend(errors.map(|error| error.to_string()));
            row.extend([held.own_median, held.own_95, held.own_largest].map(|error| error.to_string()));
            rows.push(row);
        }
        rows
    }
}

fn not_used(class: &Class) -> String {
    format!(
        "the interpolation of the galaxies with a weight of {} px is not as accurate as asked for, and all of them were read \
         out; a larger --accuracy, or a narrower range of galaxies, can be interpolated",
        class.weight_px
    )
}
