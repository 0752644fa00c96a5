//! The figures of the paper beside the computed ones, as text.

use super::figures::*;

/// All of them, as docs/paper.md shows them.
pub fn report() -> String {
    let mission = snap();
    let mut lines = vec![line("figure", "paper", "ctiplan")];
    let mut add = |figure: &str, paper: &str, computed: String| lines.push(line(figure, paper, &computed));

    let rate_mev_g_yr = mission.environment.active_dose_rate_mev_g_yr.unwrap();
    let mean_mev_g_yr = 7.0 / 11.0 * rate_mev_g_yr;
    add("dose of a mean year, 7/11 of an active one [MeV/g]", "1.6e6", format!("{mean_mev_g_yr:.3e}"));
    add("dose of 110 such years [MeV/g]", "1.78e8", format!("{:.3e}", LABORATORY_YR * mean_mev_g_yr));
    add("2e10 protons/cm2 at 8.9e-3 MeV cm2/g [MeV/g]", "1.78e10", format!("{:.2e}", 2e10 * 8.9e-3));

    let [mission_rate, paper_rate] = [MISSION_RANGE, PAPER_RANGE].map(|range| rate_per_yr(&mission, range));
    let off = |rate: f64| format!("{rate:.3e}, {:+.1} %", 100.0 * (rate / EQUATION_2_PER_YR - 1.0));
    add("equation 2, d|delta e|/dt [1/yr], 0 to 10 yr", "", off(mission_rate));
    add("the same, 0 to 220 yr as in the paper", "2.65(2)e-4", off(paper_rate));
    let times_yr = [2.0, 5.0, 20.0, 55.0, 110.0, 165.0, 220.0];
    for (t_yr, change) in times_yr.into_iter().zip(density_scan(&mission, &times_yr)) {
        let paper = match t_yr {
            2.0 => "0.49(1)e-3",
            5.0 => "1.56(2)e-3",
            110.0 => "0.028",
            _ => "",
        };
        let computed = format!("{change:.3e}, {:+.1} %", 100.0 * (change / (EQUATION_2_PER_YR * t_yr) - 1.0));
        add(&format!("|delta e| after {t_yr} yr, and over equation 2"), paper, computed);
    }
    let (exceeded_yr, corrected) = budget(&mission);
    add("1e-3 exceeded after [yr]", "about 4", format!("{exceeded_yr:.1}"));
    add("|delta e| after 5 yr over a correction by 10", "10 % of 1e-3", format!("{corrected:.2e}"));
    add("|delta e| over half the distance, of that over all", "1/2", format!("{:.3}", half_the_distance(&mission)));
    add("|delta e| with half the traps, of that with all", "1/2", format!("{:.3}", half_the_traps(&mission)));

    for (events, paper) in [(0.0, ""), (0.013, "0.999939")] {
        let cte = stacking_cte(&mission, events, 2006);
        add(&format!("CTE of 1580 e-, {events} X-ray events per pixel"), paper, format!("{cte:.6}"));
    }
    add("loss by Ci and VV over that by all species", "", format!("{:.2}", share_of_two_species(&mission)));
    add("trail in the first 45 pixels over the loss", "about 2/3", format!("{:.2}", share_of_first(&mission, 45)));

    let change = of_release(&mission);
    let scan = release_scan(&change);
    add("worst release time for shapes [transfers]", "3 to 4", format!("{:.1}", worst_release(&scan)));
    let sign = release_where_e1_changes_sign(&change);
    add("release time beyond which delta e1 > 0 [transfers]", "none", format!("{sign:.0}"));

    lines.push(String::new());
    lines.push(line("Table 2, after 110 yr", "paper", "ctiplan"));
    lines.push(line("", "delta e |dy| d", "delta e  |dy|   d [px]"));
    for row in table2() {
        let paper = format!("{:+.3} {:.2} {:.1}", row.paper_delta_e, row.paper_delta_y_px, row.paper_size_px);
        let change = row.change;
        lines.push(line(
            row.name,
            &paper,
            &format!("{:+.4} {:.3} {:.2}", change.delta_e1, change.delta_y_px.abs(), row.size_px),
        ));
    }

    lines.push(String::new());
    lines.push("One trap per pixel: change of a small, faint galaxy".into());
    lines.push("  tau [transfers]   delta e1   delta y [px]   delta size   delta flux".into());
    let never = (f64::INFINITY, change(NEVER_TRANSFERS));
    for (release, change) in scan.iter().step_by(5).chain([&never]) {
        lines.push(format!(
            "{release:>17.3} {:>+10.4} {:>+14.4} {:>+12.4} {:>+12.4}",
            change.delta_e1, change.delta_y_px, change.delta_size, change.delta_flux
        ));
    }

    lines.push(String::new());
    lines.push("Trail behind a lone event of 1580 e- after 1650 transfers".into());
    let trail = trail(&mission, 100);
    for pixel in [1, 2, 3, 5, 10, 20, 45, 100] {
        lines.push(format!("{pixel:>12} px  {:.5} of the event", trail[pixel - 1]));
    }
    lines.join("\n") + "\n"
}

fn line(figure: &str, paper: &str, computed: &str) -> String {
    format!("{figure:<50} {paper:>14}  {computed}").trim_end().into()
}
