//! Progress of a long computation.

/// Progress of a long computation.
pub struct Progress<'a> {
    /// Called at the start of a stage, with the items counted (`galaxies`, `readouts`, `draws`) and their number.
    pub stage: &'a (dyn Fn(&str, u64) + Sync),
    /// Called after each item.
    pub advance: &'a (dyn Fn() + Sync),
}

impl Progress<'static> {
    /// Without any display.
    pub const NONE: Progress<'static> = Progress { stage: &|_, _| {}, advance: &|| {} };
}
