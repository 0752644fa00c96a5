//! How far a long answer is.

/// How far it is, for long answers.
pub struct Progress<'a> {
    /// Called at the start of a stage, with what is counted (`galaxies`, `readouts`, `draws`) and their number.
    pub stage: &'a (dyn Fn(&str, u64) + Sync),
    /// Called after each.
    pub advance: &'a (dyn Fn() + Sync),
}

impl Progress<'static> {
    /// Without any display.
    pub const NONE: Progress<'static> = Progress { stage: &|_, _| {}, advance: &|| {} };
}
