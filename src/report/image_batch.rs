//! `ctiplan readout` and `ctiplan correct` for many files: one line for each.

use super::{Report, lines, or_dash, table};
use crate::image::batch::{Batch, FileDone, Outcome, Summary};

impl Report for Batch {
    fn text(&self) -> String {
        let mut files = table(&["file", "", "frames", "change [e-]", "residual [e-]", "uncertain", "warnings"]);
        for file in &self.files {
            let name = file.input.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            let summary = file.summary();
            let cell = |value: &dyn Fn(&Summary) -> Option<String>| or_dash(summary.and_then(value));
            files.add_row(vec![
                name,
                file.outcome.word().into(),
                cell(&|done| Some(done.frames.to_string())),
                cell(&|done| Some(format!("{:.4}", done.largest_change_e))),
                cell(&|done| Some(format!("{:.3e}", done.max_after_e?))),
                cell(&|done| Some(done.uncertain_px?.to_string())),
                cell(&|done| Some(done.warnings.to_string())),
            ]);
        }
        lines(&files)
    }

    fn csv(&self) -> Vec<Vec<String>> {
        let header =
            ["file", "output", "status", "frames", "largest_change_e", "max_after_e", "uncertain_px", "warnings"];
        let mut rows = vec![header.map(str::to_string).to_vec()];
        for file in &self.files {
            let paths = [&file.input, &file.output].map(|path| path.display().to_string());
            let mut row = paths.to_vec();
            row.push(file.outcome.word().into());
            if let Some(done) = file.summary() {
                row.push(done.frames.to_string());
                row.push(done.largest_change_e.to_string());
                row.push(done.max_after_e.map_or(String::new(), |value| value.to_string()));
                row.push(done.uncertain_px.map_or(String::new(), |value| value.to_string()));
                row.push(done.warnings.to_string());
            }
            row.resize(header.len(), String::new());
            rows.push(row);
        }
        rows
    }
}

impl FileDone {
    fn summary(&self) -> Option<&Summary> {
        match &self.outcome {
            Outcome::Done(summary) => Some(summary),
            _ => None,
        }
    }
}
